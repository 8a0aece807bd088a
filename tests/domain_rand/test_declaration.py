"""The declaration of randomised quantities: YAML, draws, NumPy and JAX."""

import re
from dataclasses import fields, replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refused import refusal_of

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import QUANTITIES, Randomisation, load_randomisation
from footfall.domain_rand.sample import draw, sample_shapes, towards_nominal
from footfall.train.config import load_preset

JOINTS, BODIES = 12, 13
NAMES = tuple(field.name for field in fields(Randomisation))


def fixed(numbers: np.ndarray):
    """A source of uniform numbers that always gives the first k of these."""
    return lambda k: numbers[:k]


def everything() -> Randomisation:
    """The default randomisation, with quantities of ranges that it lacks."""
    default = load_randomisation()
    left_out = {
        name: Distribution(max(quantity.lower, 0.0), quantity.upper)
        for name, quantity in QUANTITIES.items()
        if getattr(default, name) is None
    }
    return replace(default, **left_out)


@pytest.fixture(scope="module")
def uniforms() -> np.ndarray:
    return np.random.default_rng(0).random(500).astype(np.float32)


def test_the_gpu_preset_trains_on_the_default_declaration_but_mostly_on_short_delays() -> None:
    default, trained = load_randomisation(), load_preset("gpu").env.randomisation
    delays = {name: getattr(trained, name) for name in ("action_delay_s", "observation_delay_s")}
    assert trained == replace(default, **delays)
    for name, delay in delays.items():
        widest = getattr(default, name)
        assert 0.0 < delay.low < delay.high == widest.high
        assert delay.quantile(0.5) < 0.75 * widest.quantile(0.5)


def test_numpy_and_jax_draw_the_same_robot(uniforms: np.ndarray) -> None:
    randomisation = everything()
    in_numpy = draw(randomisation, fixed(uniforms), JOINTS, BODIES)
    in_jax = draw(randomisation, fixed(jnp.asarray(uniforms)), JOINTS, BODIES)
    for name in NAMES:
        np.testing.assert_allclose(in_numpy[name], in_jax[name], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("name", NAMES)
def test_a_quantity_alone_is_drawn_as_among_all_others(uniforms: np.ndarray, name: str) -> None:
    """A quantity does not change other quantities that are drawn from the same numbers."""
    whole = everything()
    alone = Randomisation(**{name: getattr(whole, name)})
    sample = draw(alone, fixed(uniforms), JOINTS, BODIES)
    assert list(sample) == [name]
    full = draw(whole, fixed(uniforms), JOINTS, BODIES)
    np.testing.assert_array_equal(sample[name], full[name])


def test_every_quantity_is_drawn_from_numbers_of_its_own(uniforms: np.ndarray) -> None:
    randomisation = everything()
    sample = draw(randomisation, fixed(uniforms.astype(np.float64)), JOINTS, BODIES)
    ranges = {name: getattr(randomisation, name) for name in NAMES}
    used = [np.ravel((sample[name] - r.low) / (r.high - r.low)) for name, r in ranges.items()]
    np.testing.assert_allclose(np.concatenate(used), uniforms[: sum(map(len, used))], atol=1e-6)


@given(st.floats(0, 1, exclude_max=True), st.floats(-5, 5), st.floats(0, 5))
def test_uniform_quantile(u: float, low: float, width: float) -> None:
    value = Distribution(low, low + width).quantile(np.array(u))
    assert low <= value <= low + width
    assert value == pytest.approx(low + u * width, abs=1e-12)


def test_log_uniform_halves_its_mass_at_the_geometric_mean() -> None:
    distribution = Distribution(0.1, 10.0, "log_uniform")
    assert distribution.quantile(np.array([0.0, 0.5])) == pytest.approx([0.1, 1.0])
    lopsided = Distribution(0.5, 8.0, "log_uniform")  # from half to sixteen times as much
    assert lopsided.quantile(np.array([0.0, 0.25, 0.75, 1.0])) == pytest.approx([0.5, 1.0, 4.0, 8.0])


def test_a_file_sets_exactly_its_quantities(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("friction: {low: 0.25, high: 1, shape: log_uniform}\nkp: {low: 0.9, high: 1.1}")
    read = load_randomisation(path)
    assert read == Randomisation(friction=Distribution(0.25, 1.0, "log_uniform"), kp=Distribution(0.9, 1.1))


def test_all_random_numbers_are_drawn_in_one_call() -> None:
    counts: list[int] = []

    def uniform(count: int) -> np.ndarray:
        counts.append(count)
        return np.full(count, 0.5)

    draw(Randomisation(), uniform, 3, 5)
    shapes = sample_shapes(3, 5)
    assert counts == [sum(int(np.prod(shape)) for shape in shapes.values())]
    names = ("link_mass", "kp", "com_offset_m", "friction")
    assert [shapes[name] for name in names] == [(5,), (3,), (3,), ()]


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_a_share_of_the_difference_is_kept_towards_the_nominal_robot(share: float) -> None:
    sample = draw(load_randomisation(), lambda k: np.linspace(0.05, 0.95, k), 12, 13)
    nominal = {
        "friction": 0.8, "payload_kg": 0.0, "com_offset_m": 0.0, "joint_damping": 0.0, "action_delay_s": 0.0,
        "observation_delay_s": 0.0, "encoder_bias": 0.0, "gyro_bias": 0.0, "gravity_bias": 0.0,
    }  # fmt: skip
    for name, value in towards_nominal(sample, share, friction=0.8).items():
        middle = nominal.get(name, 1.0)
        np.testing.assert_allclose(value, middle + share * (sample[name] - middle), err_msg=name)
    assert towards_nominal({}, share, friction=0.8) == {}


def test_malformed_declaration_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    for text, named in (
        ("friction: {low: 1.0, high: 0.5}", "friction"),
        ("friction: {low: 0.0, high: 0.5, shape: log_uniform}", "friction"),
        ("friction: {low: 0.0, high: 0.5, shape: normal}", "friction"),
        ("friction: {low: a, high: 0.5}", "friction"),
        ("friction: {low: 0.5}", "high"),
        ("friction: {low: -0.1, high: 0.5}", "friction .*0 to 10.* -0.1"),
        ("motor_strength: {low: 0.5, high: 11}", "motor_strength .*0 to 10.* 11"),
        ("link_mass: {low: 0.0, high: 1.0}", "link_mass .*0.01 to 100"),
        ("action_delay_s: {low: -0.01, high: 0.01}", "action_delay_s .*0 to 1"),
        ("friction: 0.5", "friction"),
        ("stickiness: {low: 0.5, high: 1.0}", "stickiness"),
        ("- friction", "mapping"),
        ("friction: [", "YAML"),
    ):
        path.write_text(text)
        message = refusal_of(load_randomisation, path)
        assert "mine.yaml" in message
        assert re.search(named, message), message
