"""What a diagnosis is worth to whoever repairs by it: ``m_utl`` of the diagnosis competitions.

Of one diagnosis ω against the true ω* among f parts, with n = |ω − ω*| sound parts replaced and
n̄ = |ω* − ω| faulty ones left, N = |ω| and N̄ = f − N (A. Feldman, T. Kurtoglu, S. Narasimhan et al.,
"Empirical Evaluation of Diagnostic Algorithm Performance Using a Generic Framework", IJPHM 2010):

    m_utl = 1 − n (N + 1) / (f (n + 1)) − n̄ (N̄ + 1) / (f (n̄ + 1))

Of an ambiguous set it is the mean over all pairs of a diagnosis that is told and one that no data
can tell from the truth, over what those would get by themselves (DXC 2026, synthetic track), so
that 1 is a set that holds nothing but what cannot be told apart; a part of it is worth as much.
"""

from __future__ import annotations

from collections.abc import Collection

from blind.row import Record

Diagnosis = frozenset[str]


def of_one(told: Diagnosis, true: Diagnosis, parts: int) -> float:
    """m_utl of one diagnosis among ``parts`` that may be faulty."""
    wrong, missed, left = len(told - true), len(true - told), parts - len(told)
    needless = wrong * (len(told) + 1) / (parts * (wrong + 1))
    lacking = missed * (left + 1) / (parts * (missed + 1))
    return 1.0 - needless - lacking


def of_sets(told: Collection[Diagnosis], true: Collection[Diagnosis], parts: int) -> float:
    """m_utl of an ambiguous set, 1 where it is the true one."""
    return _mean(told, true, parts) / _mean(true, true, parts)


def _mean(told: Collection[Diagnosis], true: Collection[Diagnosis], parts: int) -> float:
    pairs = [of_one(a, b, parts) for a in told for b in true]
    return sum(pairs) / len(pairs)


def of_record(record: Record, parts: int) -> float:
    """Of one effect that is hidden: whoever names nothing has the empty diagnosis; several causes
    that are named together are one diagnosis, those of an ambiguous answer are one each."""
    causes = record["causes"]
    if record["verdict"] == "ambiguous":
        told = {frozenset({cause}) for cause in causes}
    else:
        told = {frozenset(causes if record["verdict"] == "named" else ())}
    true = {frozenset({name}) for name in (*record["truth"], *record["alike"])}
    return of_sets(told, true, parts)
