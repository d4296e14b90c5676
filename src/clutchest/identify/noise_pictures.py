"""Pictures of the identified noise."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from clutchest.identify.sensor_noise import SensorNoise
from clutchest.signals import Floats

LAGS = 20


def draw_noise(sensors: Mapping[str, SensorNoise], units: Mapping[str, str], folder: Path) -> None:
    """``noise.png``: per signal the quietest readings, and the autocorrelation of what is left
    of them against the fitted one."""
    if not sensors:
        return
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 2.2 * len(sensors)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(sensors), 2, squeeze=False, width_ratios=(2, 1))
    for (name, sensor), (detail, noise_model) in zip(sensors.items(), axes, strict=True):
        quietest = int(np.argmin(np.nan_to_num(np.nanstd(sensor.windows, axis=1), nan=np.inf)))
        window = sensor.windows[quietest]
        detail.plot(window, ".-", lw=0.6, ms=3, label="readings")
        detail.plot(window - sensor.residuals[quietest], lw=1.2, label="fitted motion")
        detail.set_title(
            f"{name.replace('_', ' ')}: noise {sensor.total:.3g} {units[name]}, "
            f"correlation from sample to sample {sensor.ar:.2f}",
            loc="left",
            fontsize=9,
        )
        detail.set_ylabel(f"[{units[name]}]")
        noise_model.stem(
            range(LAGS + 1), autocorrelation(sensor.residuals), basefmt=" ", label="residuals"
        )
        noise_model.plot(fitted_autocorrelation(sensor), "C1", lw=1.2, label="fitted")
        noise_model.set_ylim(-0.3, 1.05)
    axes[0, 0].legend(fontsize=7)
    axes[0, 1].legend(fontsize=7)
    axes[0, 1].set_title("autocorrelation of the noise", loc="left", fontsize=9)
    axes[-1, 0].set_xlabel("sample")
    axes[-1, 1].set_xlabel("lag [samples]")
    figure.savefig(folder / "noise.png", dpi=110)


def autocorrelation(residuals: Floats) -> Floats:
    """Of ``residuals`` (W, n) at lags 0 … LAGS, windows without gaps only; shape (LAGS + 1,)."""
    whole = residuals[~np.isnan(residuals).any(axis=1)]
    if not len(whole):
        return np.full(LAGS + 1, np.nan)
    n = whole.shape[1]
    moments = [np.mean(whole[:, : n - lag] * whole[:, lag:]) for lag in range(LAGS + 1)]
    return np.array(moments) / max(moments[0], 1e-300)


def fitted_autocorrelation(sensor: SensorNoise) -> Floats:
    """Of AR(1) noise and rounding; shape (LAGS + 1,)."""
    shares: Floats = sensor.noise**2 * sensor.ar ** np.arange(LAGS + 1.0)
    shares[0] = sensor.total**2
    return np.asarray(shares / sensor.total**2, np.float64)
