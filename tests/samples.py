"""Frames and a DBC that hold something of everything."""

import numpy as np

from clutchest.can.frames import Flag, Frames

EVERYTHING = """VERSION ""
BS_:
BU_: A
BO_ 256 Floats: 16 A
 SG_ Double : 0|64@1- (1,0) [0|0] "" A
 SG_ Single : 71|32@0- (0.5,-3) [0|0] "" A
 SG_ Half : 96|16@1- (1,0) [0|0] "" A
BO_ 257 Wide: 8 A
 SG_ Whole : 0|64@1+ (3,-7) [0|0] "" A
BO_ 258 WideSigned: 8 A
 SG_ Whole : 7|64@0- (0.1,1) [0|0] "" A
BO_ 259 Odd: 8 A
 SG_ A : 3|61@1- (1,0.5) [0|0] "" A
BO_ 260 Crossing: 8 A
 SG_ A : 5|13@0- (0.25,-40) [0|0] "" A
 SG_ B : 21|23@1+ (1e-3,2) [0|0] "" A
 SG_ C : 45|1@1- (1,0) [0|0] "" A
 SG_ D : 51|11@0+ (2.0,4.0) [0|0] "" A
BO_ 261 Switched: 8 A
 SG_ M M : 0|3@1+ (1,0) [0|0] "" A
 SG_ A m0 : 8|8@1+ (1,0) [0|0] "" A
 SG_ B m1M : 8|8@1+ (1,0) [0|0] "" A
 SG_ C m3 : 16|16@1- (0.5,0) [0|0] "" A
 SG_ D m2 : 24|16@1+ (1,0) [0|0] "" A
 SG_ E : 56|8@1+ (1,0) [0|0] "" A
SG_MUL_VAL_ 261 A M 0-0,4-6;
SG_MUL_VAL_ 261 B M 1-2;
SG_MUL_VAL_ 261 C B 3-100;
SG_MUL_VAL_ 261 D M 7-7;
SIG_VALTYPE_ 256 Double : 2;
SIG_VALTYPE_ 256 Single : 1;
SIG_VALTYPE_ 256 Half : 1;
"""


def random_frames(n: int, seed: int, fd: bool = False) -> Frames:
    """Frames as they come on a bus, stamps to the microsecond."""
    rng = np.random.default_rng(seed)
    frames = Frames.empty(n, 64 if fd else 8)
    frames.t_ns[:] = 1_700_000_000 * 10**9 + np.cumsum(rng.integers(1, 5000, n)) * 1000
    frames.channel[:] = rng.integers(0, 3, n)
    extended = rng.random(n) < 0.5
    frames.id[:] = np.where(extended, rng.integers(0, 2**29, n), rng.integers(0, 2**11, n))
    frames.flags[:] = np.where(extended, Flag.EXTENDED, 0)
    frames.length[:] = rng.integers(0, 9, n)
    if fd:
        wide = rng.random(n) < 0.5
        frames.length[wide] = rng.choice([12, 16, 20, 24, 32, 48, 64], wide.sum())
        frames.flags[wide] |= np.uint8(Flag.FD)
        frames.flags[wide & (rng.random(n) < 0.5)] |= np.uint8(Flag.BITRATE_SWITCH)
    frames.data[:] = rng.integers(0, 256, frames.data.shape)
    frames.data[np.arange(frames.data.shape[1]) >= frames.length[:, None]] = 0
    return frames
