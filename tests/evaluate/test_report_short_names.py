"""Names of policies in a report: complete where there is room, otherwise without their middle."""

from footfall.evaluate.report.short_names import MAX_CHARS, short_names

LONG = "runs/2026-11-23_go1_without-height-scan_seed-17_policy-final"


def test_a_short_name_stays_unchanged() -> None:
    names = ["mpc", "x" * MAX_CHARS]
    assert short_names(names) == {name: name for name in names}


def test_a_longer_name_keeps_its_beginning_and_its_end() -> None:
    (short,) = short_names([LONG]).values()
    assert len(short) == MAX_CHARS
    assert short == f"{LONG[:12]}…{LONG[-19:]}"


def test_shortened_names_stay_different() -> None:
    others = [LONG.replace("height", kind) for kind in ("camera", "memory")]
    found = short_names([LONG, *others])
    assert len(set(found.values())) == 3
    assert [short[-4:] for short in found.values()] == ["inal", " (2)", " (3)"]
    assert max(map(len, found.values())) == MAX_CHARS
    taken = short_names([LONG])[LONG]
    assert short_names([LONG, taken])[taken] == taken != short_names([LONG, taken])[LONG]
