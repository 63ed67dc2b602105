"""Maps of currents: the kernels, the fit, the posterior, samples; all small."""

import numpy as np
import pytest

from glider_stream.base.errors import InputError
from glider_stream.water.mapping import (
    Observations,
    Scales,
    at_points,
    condition,
    dive_averages,
    drifts,
    fit_scales,
    fitting,
)
from glider_stream.water.mapping.covariance import covariance, variance
from glider_stream.water.mapping.features import draw
from glider_stream.water.mapping.gridded import gridded

WIDE, DEEP, LONG = 80e3, 400.0, 2 * 86_400.0
SCALES = Scales(0.2, 20e3, depth=60.0, time=86_400.0, noise=0.02, mean=0.1)


def places(count, seed=0):
    share = np.random.default_rng(seed).random((4, count))
    return share[0] * WIDE, share[1] * WIDE, share[2] * DEEP, share[3] * LONG


def measured(current, count=60, seed=0, noise=0.02):
    x, y, depth, t = places(count, seed)
    values = current.velocity(x, y, depth, t) + noise * np.random.default_rng(seed + 1).normal(size=(count, 2))
    return at_points(x, y, depth, values[:, 0], values[:, 1], t=t)


@pytest.fixture(scope="module")
def truth():
    return draw(SCALES, np.random.default_rng(5))


@pytest.fixture(scope="module")
def mapped(truth):
    return condition(measured(truth), SCALES)


def psi_covariance(scales, r, dz, dt):
    """The prior of the stream function, written out: Matern 5/2 (or Gaussian) in place, 3/2 in depth and time."""
    if scales.kernel == "gaussian":
        phi = scales.length**2 * np.exp(-(r**2) / (2 * scales.length**2))
    else:
        s = np.sqrt(5) * r / scales.length
        phi = 3 / 5 * scales.length**2 * (1 + s + s**2 / 3) * np.exp(-s)
    s = np.sqrt(3) * np.abs(dz) / scales.depth
    depth = (1 + s) * np.exp(-s)
    s = np.sqrt(3) * np.abs(dt) / scales.time
    return scales.speed**2 * phi * depth * (1 + s) * np.exp(-s)


@pytest.mark.parametrize("kernel", ["matern", "gaussian"])
def test_velocities_covary_as_derivatives_of_the_stream_function(kernel):
    """cov(u, v') and the others, by central differences of the covariance of psi."""
    scales = Scales(0.3, 15e3, depth=50.0, time=5e4, kernel=kernel)
    a, b = np.array([1e3, 2e3, 30.0, 1e4]), np.array([9e3, -4e3, 80.0, 3e4])
    deep = [20 * np.log1p(place[2] / 20) for place in (a, b)]

    def psi(ax, ay, bx, by):
        return psi_covariance(scales, np.hypot(ax - bx, ay - by), deep[0] - deep[1], a[3] - b[3])

    step = 20.0

    def derivative(first, second):
        """By coordinate `first` of a and `second` of b."""
        total = 0.0
        for i in (-1, 1):
            for j in (-1, 1):
                at, to = a[:2].copy(), b[:2].copy()
                at[first] += i * step
                to[second] += j * step
                total += i * j * psi(*at, *to)
        return total / (4 * step**2)

    one, two = (at_points(*place[:3], 0.0, 0.0, t=place[3]) for place in (a, b))
    found = covariance(scales, one, two)
    # u = d psi / dy, v = -d psi / dx
    wanted = [[derivative(1, 1), -derivative(1, 0)], [-derivative(0, 1), derivative(0, 0)]]
    assert found == pytest.approx(np.array(wanted), rel=2e-4, abs=1e-7)
    assert np.diag(covariance(scales, one, one)) == pytest.approx(0.3**2)


def flux(current, corners, depth, t, count=300):
    """The flow out of a polygon, by Gauss-Legendre quadrature along its sides [m^2/s]."""
    node, weight = np.polynomial.legendre.leggauss(count)
    total = 0.0
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        at = (a + b) / 2 + node[:, None] * (b - a) / 2
        u, v = current.velocity(at[:, 0], at[:, 1], depth, t).T
        dx, dy = (b - a) / 2
        total += float(weight @ (u * dy - v * dx))
    return total


def test_mean_and_samples_have_no_divergence(mapped):
    """What flows out of a polygon is 0, and between two places the stream function's difference."""
    (sample,) = mapped.samples(1, seed=3)
    corners = np.array([[21e3, 18e3], [33e3, 22e3], [29e3, 34e3], [17e3, 29e3]])
    for current in (mapped, sample):
        passing = 0.2 * 12e3
        assert abs(flux(current, corners, 120.0, 4e4)) < 1e-11 * passing
        # along one side alone: u dy - v dx adds up to the difference of psi
        node, weight = np.polynomial.legendre.leggauss(300)
        (a, b) = corners[:2]
        at = (a + b) / 2 + node[:, None] * (b - a) / 2
        u, v = current.velocity(at[:, 0], at[:, 1], 120.0, 4e4).T
        dx, dy = (b - a) / 2
        ends = current.stream(*corners[:2].T, 120.0, 4e4)
        assert float(weight @ (u * dy - v * dx)) == pytest.approx(ends[1] - ends[0], rel=1e-9)


def test_without_noise_the_map_passes_through_the_measurements(truth):
    at = measured(truth, 25, noise=0.0)
    scales = Scales(0.2, 20e3, depth=60.0, time=86_400.0)
    found = condition(at, scales)
    where = (at.x, at.y, at.depth, at.t)
    assert found.velocity(*where) == pytest.approx(np.stack([at.u, at.v], axis=-1), abs=1e-6)
    assert found.deviation(*where).max() < 1e-3
    # far away nothing is known
    assert found.velocity(9e6, 9e6) == pytest.approx(0.0, abs=1e-12)
    assert found.deviation(9e6, 9e6) == pytest.approx(0.2)


def test_the_posterior_is_the_textbook_one(truth):
    """Mean and deviation by the plain formula, with an inverse, of dives, drifters and points together."""
    points = measured(truth, 8)
    dives = dive_averages([[1e4, 1e4], [2e4, 3e4]], [[1.3e4, 1e4], [2.5e4, 3e4]], [300.0, 200.0], [0.1, 0.2], 0.1)
    drift = drifts([0.0, 2e3, 5e3], [0.0, 1e3, 1e3], [0.0, 1e4, 2e4], 15.0, error=0.01)
    at = Observations.joined([points, dives, drift])
    target = at_points([2e4, 4e4], [1e4, 2e4], [50.0, 10.0], 0.0, 0.0, t=[0.0, 1e4])
    whole = covariance(SCALES, at, at) + np.diag(np.tile(at.error**2 + SCALES.noise**2, 2))
    across = covariance(SCALES, target, at)
    wanted = across @ np.linalg.inv(whole) @ at.values
    left = covariance(SCALES, target, target) - across @ np.linalg.inv(whole) @ across.T
    found, where = condition(at, SCALES), (target.x, target.y, target.depth, target.t)
    assert found.velocity(*where).T.ravel() == pytest.approx(wanted, rel=1e-6)
    assert found.deviation(*where).T.ravel() == pytest.approx(np.sqrt(np.diag(left)), rel=1e-6)


def test_a_dive_is_the_mean_over_its_path(truth):
    """The quadrature of a dive against a sum over a thousand points of its path; weights add up to 1."""
    start, end, times = np.array([[1e4, 2e4]]), np.array([[1.4e4, 2.2e4]]), (1e4, 2.2e4)
    at = dive_averages(start, end, 350.0, 0.0, 0.0, times=times)
    share = (np.arange(1000) + 0.5) / 1000
    x, y = (start + share[:, None] * (end - start)).T
    depth = 350.0 * (1 - np.abs(2 * share - 1))
    wanted = truth.velocity(x, y, depth, times[0] + share * (times[1] - times[0])).mean(axis=0)
    assert at.means(truth.velocity(at.x, at.y, at.depth, at.t))[0] == pytest.approx(wanted, abs=5e-4)
    several = dive_averages(start, end, 350.0, 0.0, 0.0, times=times, yos=4)
    for part in (at, several, drifts([0.0, 1.0, 3.0], [0.0, 0.0, 1.0], [0.0, 10.0, 15.0])):
        assert part.means(np.ones(part.x.size)) == pytest.approx(1.0)
    assert drifts([0.0, 3.0], [0.0, 4.0], [0.0, 10.0]).values == pytest.approx([0.3, 0.4])


def test_taking_some_measurements_and_blocks_change_nothing(truth, monkeypatch):
    dives = dive_averages(np.full((9, 2), 1e4) * np.arange(9)[:, None], np.full((9, 2), 2e4), 300.0, 0.1, 0.0)
    at = Observations.joined([measured(truth, 5), dives])
    whole = covariance(SCALES, at, at)
    some = np.array([2, 7, 11])
    index = np.concatenate([some, at.count + some])
    assert covariance(SCALES, at.take(some), at) == pytest.approx(whole[index], rel=1e-12)
    assert variance(SCALES, at) == pytest.approx(np.diag(whole))
    monkeypatch.setattr("glider_stream.water.mapping.covariance.AT_ONCE", 300)
    assert covariance(SCALES, at, at) == pytest.approx(whole, rel=1e-12)


def test_the_gradient_of_the_likelihood(truth):
    at = Observations.joined([measured(truth, 12), dive_averages([[1e4, 1e4]], [[1.3e4, 1e4]], 300.0, 0.1, 0.1)])
    for kernel in ("matern", "gaussian"):
        expected, free, _ = fitting._expected(at, {}, kernel)
        assert free == fitting.FITTED

        def loss(logs, expected=expected, free=free):
            return fitting._loss(at, fitting._moved(expected, free, logs), free, expected, logs)

        logs = np.array([0.2, -0.3, 0.4, 0.1, -0.2])
        for n, slope in enumerate(loss(logs)[1]):
            step = 1e-5 * np.eye(5)[n]
            assert (loss(logs + step)[0] - loss(logs - step)[0]) / 2e-5 == pytest.approx(slope, rel=1e-5)


@pytest.mark.slow
def test_the_fit_finds_the_scales(truth):
    fit = fit_scales(measured(truth, 100))
    for name in ("speed", "length", "depth", "time"):
        off = np.log(getattr(fit.scales, name) / getattr(SCALES, name))
        assert abs(off) < 4 * fit.errors[name] < 1.2, name
    assert not fit.undetermined or fit.undetermined == ("noise",)
    assert "fitted to 100 of 100" in str(fit)


def test_a_scale_that_measurements_cannot_tell_is_said(truth):
    """Dives to one depth tell nothing about the depth over which currents are alike."""
    start = np.random.default_rng(2).random((10, 2)) * WIDE
    dives = dive_averages(start, start + 2e3, 300.0, 0.0, 0.0)
    values = dives.means(truth.velocity(dives.x, dives.y, dives.depth, 0 * dives.t))
    at = dive_averages(start, start + 2e3, 300.0, values[:, 0], values[:, 1])
    fit = fit_scales(at)
    assert "depth" in fit.undetermined
    assert "hardly tell it" in str(fit)
    assert fit.held["time"].startswith("all measurements are at one time")
    assert fit.as_dict()["scales"]["time"] is None


def test_samples_have_the_maps_mean_and_deviation(mapped):
    x, y, depth, t = places(6, seed=9)
    drawn = np.array([sample.velocity(x, y, depth, t) for sample in mapped.samples(80, seed=1)])
    mean, deviation = mapped.velocity(x, y, depth, t), mapped.deviation(x, y, depth, t)
    assert np.abs((drawn.mean(axis=0) - mean) / deviation).max() < 4 / np.sqrt(80)
    assert drawn.std(axis=0) / deviation == pytest.approx(1.0, abs=0.35)
    again = mapped.samples(2, seed=1)[1].velocity(x, y, depth, t)
    assert (again == drawn[1]).all()


@pytest.mark.parametrize("kernel", ["matern", "gaussian"])
def test_waves_have_the_priors_covariance(kernel):
    scales = Scales(0.2, 20e3, depth=60.0, time=86_400.0, mean=0.1, kernel=kernel)
    at = at_points([0.0, 8e3], [0.0, 5e3], [0.0, 60.0], 0.0, 0.0, t=[0.0, 3e4])
    generator = np.random.default_rng(0)
    drawn = np.array(
        [draw(scales, generator, 60).velocity(at.x, at.y, at.depth, at.t).T.ravel() for _ in range(3000)]
    )
    assert drawn.T @ drawn / 3000 == pytest.approx(covariance(scales, at, at), abs=5 * 0.05 / np.sqrt(3000))


def test_grids_hold_what_points_hold(mapped):
    (sample,) = mapped.samples(1)
    x, y, _, _ = places(5, seed=4)
    depth, t = np.array([0.0, 90.0, 300.0]), np.array([0.0, 5e4])
    for current in (mapped, sample):
        found = current.on_grid(x, y, depth, t)
        assert found.shape == (2, 3, 5, 2)
        assert found[1, 2] == pytest.approx(current.velocity(x, y, 300.0, 5e4), rel=1e-9)
    assert mapped.deviation_on_grid(x, y, depth, t)[1, 2] == pytest.approx(mapped.deviation(x, y, 300.0, 5e4))


def test_a_grid_for_the_planner_says_its_error(mapped):
    axes = [np.linspace(1e4, 6e4, count) for count in (11, 41)]
    coarse, fine = (gridded(mapped, x, x, np.linspace(0, 200, 9)) for x in axes)
    assert 0.001 < fine.error < coarse.error / 2 < 0.05
    assert fine.rms_error < fine.error
    assert fine.flow.extent.max_speed == pytest.approx(0.4, abs=0.3)


def test_inducing_measurements(truth, mapped):
    """All of them: the exact map. Some: no divergence, and a deviation that is not smaller."""
    at = measured(truth, 60)
    some = condition(at, SCALES, inducing=20)
    x, y, depth, t = places(30, seed=8)
    assert some.inducing.count == 20
    assert (some.deviation(x, y, depth, t) > 0.98 * mapped.deviation(x, y, depth, t)).all()
    corners = np.array([[21e3, 18e3], [33e3, 22e3], [29e3, 34e3]])
    assert abs(flux(some, corners, 120.0, 4e4)) < 1e-11 * 0.2 * 12e3
    off = truth.velocity(x, y, depth, t) - some.velocity(x, y, depth, t)
    assert np.sqrt((off**2).mean()) < np.sqrt((truth.velocity(x, y, depth, t) ** 2).mean())
    same = condition(at, SCALES, inducing=60)
    assert (same.velocity(x, y, depth, t) == mapped.velocity(x, y, depth, t)).all()


def test_refusals(truth, monkeypatch):
    at = measured(truth, 5)
    monkeypatch.setattr("glider_stream.water.mapping.conditioned.MOST_EXACT", 4)
    for act, sentence in (
        (lambda: condition(at, SCALES), "an exact map takes at most 4 measurements; got 5: .* set `inducing`"),
        (lambda: condition(at, SCALES, inducing=0), "`inducing` must be at least 1; got 0"),
        (lambda: fit_scales(at, {"width": 1.0}), "the scale `width` is not known; choose from: speed"),
        (lambda: fit_scales(at, kernel="cubic"), "`kernel` must be one of matern, gaussian; got 'cubic'"),
        (lambda: fit_scales(at_points([0.0, 1.0], 0.0, 0.0, 0.0, 0.0)), "every measurement is exactly 0 m/s"),
        (lambda: fit_scales(at_points([0.0, 0.0], 0.0, 0.0, 0.1, 0.2)), "all measurements are at one place"),
        (lambda: at_points([0.0], 0.0, -5.0, 0.1, 0.2), "a depth counts downward; got -5 m"),
        (lambda: at_points([0.0], np.nan, 0.0, 0.1, 0.2), "`y` of measurements must be finite"),
        (lambda: at_points([0.0, 1.0], [0.0], 0.0, 0.1, 0.2), r"`y` must be a number or have the shape \(2,\)"),
        (lambda: drifts([0.0, 1.0], [0.0, 1.0], [5.0, 5.0]), "must follow each other in time"),
        (lambda: dive_averages([[0.0, 0.0]], [[1.0, 0.0]], 0.0, 0.1, 0.1), "a dive must go below its top"),
        (lambda: Scales(0.1, -1.0), "`length` must be above 0 and finite; got -1"),
    ):
        with pytest.raises(InputError, match=sentence):
            act()
