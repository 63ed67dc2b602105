"""Maps of currents against the truth and against what people use: calibration, errors with intervals, times.

    python benchmarks/mapping.py --ionian CURRENTS.nc -o benchmarks/records/mapping.json

Synthetic fields are draws of the prior, each with scales of its own, and sums of random vortices, which are not.
The others: linear interpolation (nearest beyond the outermost points), a Gaussian process of each component
(scikit-learn, RBF or Matern kernel with white noise, fitted; the better of both by likelihood), and optimal
interpolation (an exponential of the squared distance for each component, its scale and noise by leave-one-out).
scikit-learn is needed for this script only. Intervals are 95 %, by the bootstrap over fields, thinnings, columns.
"""

import argparse
import json
import platform
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.special import ndtri

from glider_stream.water.frame import LocalFrame
from glider_stream.water.mapping import Observations, Scales, at_points, condition, dive_averages, fit_scales
from glider_stream.water.mapping.features import draw
from glider_stream.water.mapping.gridded import gridded
from glider_stream.water.mapping.measured import turned
from glider_stream.water.ocean import OceanFile, read_currents

Array = np.ndarray
SIDE = 100e3
LEVELS = (0.5, 0.8, 0.95)
NOISE = 0.01


def interval(values: Array, statistic: Callable[[Array], float], seed: int = 0) -> list[float]:
    """A statistic of rows of values and its 95 % interval by the bootstrap."""
    generator = np.random.default_rng(seed)
    drawn = [statistic(values[generator.integers(0, len(values), len(values))]) for _ in range(2000)]
    return [round(float(value), 4) for value in (statistic(values), *np.quantile(drawn, [0.025, 0.975]))]


def ratio(rows: Array) -> float:
    """The root of the ratio of summed squared errors, (n, 2): ours over the other's."""
    return float(np.sqrt(rows[:, 0].sum() / rows[:, 1].sum()))


# calibration


def random_scales(generator: np.random.Generator) -> Scales:
    """Scales of a mesoscale current."""
    return Scales(
        speed=generator.uniform(0.1, 0.3),
        length=generator.uniform(12e3, 35e3),
        depth=generator.uniform(30, 120),
        time=generator.uniform(1, 5) * 86_400,
        noise=0.02,
        mean=0.1,
    )


def calibration(fields: int) -> dict[str, Any]:
    """How much withheld truth intervals hold: 100 points and 20 dives, scales fitted, 200 points withheld."""
    held, off, widths, long = [], [], [], 3 * 86_400
    for field in range(fields):
        generator = np.random.default_rng([1, field])
        truth = draw(random_scales(generator), generator)
        x, y, z, t = generator.random((4, 300)) * np.array([[SIDE], [SIDE], [600.0], [long]])
        values = truth.velocity(x, y, z, t)
        seen = values[:100] + 0.02 * generator.normal(size=(100, 2))
        points = at_points(x[:100], y[:100], z[:100], *seen.T, t=t[:100])
        start = generator.random((20, 2)) * SIDE
        end, begin = start + generator.normal(0, 2e3, (20, 2)), generator.random(20) * long
        times = begin, begin + 4 * 3600
        dives = dive_averages(start, end, 600.0, 0.0, 0.0, times=times)
        mean = dives.means(truth.velocity(dives.x, dives.y, dives.depth, dives.t))
        mean += 0.02 * generator.normal(size=mean.shape)
        dives = dive_averages(start, end, 600.0, *mean.T, times=times)
        at = Observations.joined([points, dives])
        found = condition(at, fit_scales(at).scales)
        where = (x[100:], y[100:], z[100:], t[100:])
        deviation = found.deviation(*where)
        error = np.abs(found.velocity(*where) - values[100:])
        held.append([float((error < ndtri(0.5 + level / 2) * deviation).mean()) for level in LEVELS])
        off.append([float((error**2).mean()), float((values[100:] ** 2).mean())])
        widths.append(float(deviation.mean()))
    rows = np.array(held)
    shares = {f"{level:.0%}": interval(rows[:, n], np.mean) for n, level in enumerate(LEVELS)}  # type: ignore[arg-type]
    return {"fields": fields, "held": shares, "error_over_truth": interval(np.array(off), ratio)}


def by_dives(fields: int) -> dict[str, Any]:
    """The error that is left near the track of 14 dives to 600 m, over that of knowing nothing."""
    deep, every = [], []
    for field in range(fields):
        generator = np.random.default_rng([2, field])
        scales = replace(random_scales(generator), time=np.inf, mean=0.0)
        truth = draw(scales, generator)
        turn = generator.uniform(0, 2 * np.pi)
        along = np.array([np.cos(turn), np.sin(turn)])
        stops = np.arange(15)[:, None] * 5e3 * along
        dives = dive_averages(stops[:-1], stops[1:], 600.0, 0.0, 0.0)
        mean = dives.means(truth.velocity(dives.x, dives.y, dives.depth, dives.t))
        mean += NOISE * generator.normal(size=mean.shape)
        dives = dive_averages(stops[:-1], stops[1:], 600.0, *mean.T, error=NOISE)
        fit = fit_scales(dives, {"mean": 0.0})
        found = condition(dives, fit.scales)
        # places up to a quarter of a length beside the track
        share = generator.random(200) * 70e3
        beside = generator.uniform(-0.25, 0.25, 200) * scales.length
        x, y = (share * along[n] + beside * (-along[1], along[0])[n] for n in range(2))
        levels = np.linspace(0, 600, 13)
        real, guess = (part.on_grid(x, y, levels, np.zeros(1))[0] for part in (truth, found))
        every.append([((real - guess) ** 2).mean(), (real**2).mean()])
        real, guess = real.mean(axis=0), guess.mean(axis=0)
        deep.append([((real - guess) ** 2).mean(), (real**2).mean()])
    return {
        "fields": fields,
        "mean_over_depth": interval(np.array(deep), ratio),
        "every_depth": interval(np.array(every), ratio),
    }


# against what people use


def linear(at: Array, values: Array, to: Array) -> Array:
    """Linear interpolation in triangles; beyond their hull the nearest value."""
    inside = LinearNDInterpolator(at, values)(to)
    return np.where(np.isnan(inside), NearestNDInterpolator(at, values)(to), inside)


def independent(at: Array, values: Array, to: Array) -> Array:
    """A Gaussian process of each component alone, fitted by scikit-learn."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel

    unit = float(np.ptp(at, axis=0).max())
    found = np.empty((len(to), 2))
    for n in range(2):
        scale = values[:, n].std()
        best = None
        for kind in (RBF(0.2, (1e-2, 1e1)), Matern(0.2, (1e-2, 1e1), nu=1.5)):
            kernel = ConstantKernel(1.0, (1e-2, 1e2)) * kind + WhiteKernel(1e-2, (1e-8, 1e0))
            model = GaussianProcessRegressor(kernel, n_restarts_optimizer=2, random_state=0)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ConvergenceWarning)
                model.fit(at / unit, (values[:, n] - values[:, n].mean()) / scale)
            if best is None or model.log_marginal_likelihood_value_ > best.log_marginal_likelihood_value_:
                best = model
        found[:, n] = best.predict(to / unit) * scale + values[:, n].mean()  # type: ignore[union-attr]
    return found


def optimal(at: Array, values: Array, to: Array) -> Array:
    """Optimal interpolation of each component; scale and noise, for both, with the least leave-one-out error."""
    apart = ((at[:, None] - at) ** 2).sum(axis=-1)
    unit, mean = float(np.ptp(at, axis=0).max()), values.mean(axis=0)
    best, least = (0.0, 0.0), np.inf
    for length in unit * np.geomspace(0.03, 0.5, 10):
        for noise in (1e-4, 1e-2, 3e-2, 1e-1, 3e-1):
            inverse = np.linalg.inv(np.exp(-apart / (2 * length**2)) + noise * np.eye(len(at)))
            left = float((((inverse @ (values - mean)) / np.diag(inverse)[:, None]) ** 2).mean())
            if left < least:
                best, least = (length, noise), left
    length, noise = best
    weights = np.linalg.solve(np.exp(-apart / (2 * length**2)) + noise * np.eye(len(at)), values - mean)
    return mean + np.exp(-((to[:, None] - at) ** 2).sum(axis=-1) / (2 * length**2)) @ weights


def ours(at: Array, values: Array, to: Array) -> Array:
    """The kernel whose fit is the likelier."""
    seen = at_points(*at.T, 0.0, *values.T)
    fits = [fit_scales(seen, kernel=kernel) for kernel in ("matern", "gaussian")]
    best = max(fits, key=lambda fit: fit.log_likelihood)
    return condition(seen, best.scales).velocity(*to.T)


METHODS = {"ours": ours, "linear": linear, "independent": independent, "optimal": optimal}


def errors(at: Array, values: Array, to: Array, wanted: Array) -> dict[str, float]:
    """Mean squared errors [m^2/s^2] of every method."""
    return {name: float(((method(at, values, to) - wanted) ** 2).mean()) for name, method in METHODS.items()}


def against(rows: list[dict[str, float]]) -> dict[str, Any]:
    """Root mean square errors [m/s], and ours over each other's, with intervals."""
    found: dict[str, Any] = {"cases": len(rows)}
    for name in METHODS:
        found[name] = interval(np.array([row[name] for row in rows]), lambda some: float(np.sqrt(some.mean())))
    for name in METHODS:
        if name != "ours":
            found[f"ours_over_{name}"] = interval(np.array([[row["ours"], row[name]] for row in rows]), ratio)
    return found


def vortices(generator: np.random.Generator) -> Callable[[Array], Array]:
    """A sum of 20 Gaussian vortices in the square, up to some 0.5 m/s."""
    centre = generator.random((20, 2)) * SIDE
    radius, speed = generator.uniform(6e3, 20e3, 20), generator.uniform(-0.3, 0.3, 20)

    def velocity(at: Array) -> Array:
        d = at[:, None] - centre
        pull = speed / radius * np.exp(0.5 - (d**2).sum(axis=-1) / (2 * radius**2))
        return np.stack([-(pull * d[..., 1]).sum(axis=1), (pull * d[..., 0]).sum(axis=1)], axis=-1)

    return velocity


def synthetic(fields: int, of: str) -> dict[str, Any]:
    """80 noisy points of each field, 400 withheld."""
    rows = []
    for field in range(fields):
        generator = np.random.default_rng([3, field])
        at, to = generator.random((80, 2)) * SIDE, generator.random((400, 2)) * SIDE
        if of == "vortices":
            current = vortices(generator)
        else:
            kernel = ("matern", "gaussian")[field % 2]
            waves = draw(Scales(0.2, generator.uniform(15e3, 35e3), kernel=kernel), generator)

            def current(at: Array, waves: Any = waves) -> Array:
                return waves.velocity(*at.T, np.zeros(len(at)), np.zeros(len(at)))

        values = current(at) + NOISE * generator.normal(size=at.shape)
        rows.append(errors(at, values, to, current(to)))
    return against(rows)


def columns_of(file: OceanFile) -> tuple[LocalFrame, Array, Array, Array]:
    """The frame, the places of the columns (ny, nx, 2) [m], and the currents (nz, ny, nx, 2) in the frame."""
    frame = LocalFrame.over(*file.grid.bounds)
    lon, lat = file.grid.mesh()
    at = np.stack(frame.to_local(lon, lat), axis=-1)
    parts = [turned(frame, lon, lat, u, v) for u, v in zip(file.u[0], file.v[0], strict=True)]
    return frame, at, np.stack([np.stack(part, axis=-1) for part in parts]), lat


def thinned_ionian(file: OceanFile, depths: list[float], thinnings: int) -> dict[str, Any]:
    """5 % of a level's points are kept, all others withheld."""
    _, at, current, _ = columns_of(file)
    found = {}
    for depth in depths:
        level = int(np.abs(file.depth - depth).argmin())
        wet = np.isfinite(current[level, ..., 0])
        places, values = at[wet], current[level][wet].astype(np.float64)
        rows = []
        for thinning in range(thinnings):
            chosen = np.random.default_rng([4, thinning]).permutation(len(places))
            kept, rest = np.split(chosen, [round(0.05 * len(places))])
            rows.append(errors(places[kept], values[kept], places[rest], values[rest]))
        found[f"{file.depth[level]:.0f} m"] = {"kept": len(kept), "withheld": len(rest), **against(rows)}
    return found


def thinned_depths(file: OceanFile, columns: int) -> dict[str, Any]:
    """Every third level is kept, down to the last wet one; what lies between is put back, column by column.

    Where all columns are measured at all kept levels, a map of them all is, without noise, that of each alone.
    """
    _, at, current, _ = columns_of(file)
    wet = np.isfinite(current[..., 0]).sum(axis=0)
    deep = np.argwhere(wet >= 10)
    chosen = np.random.default_rng(5).permutation(deep)[:columns]

    def column(j: int, i: int, levels: Array) -> Observations:
        x, y = np.full(levels.size, at[j, i, 0]), np.full(levels.size, at[j, i, 1])
        return at_points(x, y, file.depth[levels], *current[levels, j, i].T.astype(np.float64))

    fitted = Observations.joined([column(j, i, np.arange(0, wet[j, i], 3)) for j, i in chosen[:45]])
    fit = fit_scales(fitted, {"mean": 0.0, "noise": 1e-4})
    rows: list[list[float]] = []
    by_level: dict[int, list[list[float]]] = {}
    for j, i in chosen:
        kept = np.arange(0, wet[j, i], 3)
        put = np.setdiff1d(np.arange(kept[-1]), kept)
        seen = column(j, i, kept)
        ours_here = condition(seen, fit.scales).velocity(at[j, i, 0], at[j, i, 1], file.depth[put])
        line = np.stack([np.interp(file.depth[put], seen.depth, part) for part in (seen.u, seen.v)], axis=-1)
        off, other = ((part - current[put, j, i]) ** 2 for part in (ours_here, line))
        rows.append([off.sum(), other.sum(), put.size])
        for k, a, b in zip(put, off.sum(axis=1), other.sum(axis=1), strict=True):
            by_level.setdefault(int(k), []).append([a, b])
    table = np.array(rows)
    levels = {f"{file.depth[k]:.0f} m": round(ratio(np.array(v)), 3) for k, v in sorted(by_level.items())}
    return {
        "columns": len(chosen),
        "scales": str(fit.scales),
        "ours": interval(table, lambda some: float(np.sqrt(some[:, 0].sum() / some[:, 2].sum() / 2))),
        "linear": interval(table, lambda some: float(np.sqrt(some[:, 1].sum() / some[:, 2].sum() / 2))),
        "ours_over_linear": interval(table[:, :2], ratio),
        "ours_over_linear_by_level": levels,
    }


def speed(measurements: int) -> dict[str, Any]:
    """Seconds for the fit, the map, its mean and deviation on a grid of 100 by 100 points; the grid's error."""
    generator = np.random.default_rng(6)
    scales = Scales(0.2, 20e3, depth=60.0, time=86_400.0, noise=0.02)
    truth = draw(scales, generator)
    x, y, z, t = generator.random((4, measurements)) * np.array([[2 * SIDE], [2 * SIDE], [600.0], [3 * 86_400]])
    values = truth.velocity(x, y, z, t) + 0.02 * generator.normal(size=(measurements, 2))
    at = at_points(x, y, z, *values.T, t=t)
    marks = [time.perf_counter()]
    fit = fit_scales(at)
    marks.append(time.perf_counter())
    found = condition(at, fit.scales)
    px, py = (part.ravel() for part in np.meshgrid(*[np.linspace(0, 2 * SIDE, 100)] * 2))
    found.on_grid(px, py, np.array([0.0]), np.array([86_400.0]))
    marks.append(time.perf_counter())
    found.deviation(px, py, 0.0, 86_400.0)
    marks.append(time.perf_counter())
    names = ("fit_s", "map_and_mean_s", "deviation_s")
    took = {name: round(b - a, 2) for name, a, b in zip(names, marks[:-1], marks[1:], strict=True)}
    axis = np.linspace(0, 2 * SIDE, 101)
    grid = gridded(found, axis, axis, np.array([0.0, 50.0, 100.0]))
    error = {"grid_every_2_km_error_mps": round(grid.error, 4), "rms_mps": round(grid.rms_error, 4)}
    return {"measurements": measurements, **took, **error}


def main() -> None:
    """Measure the parts that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ionian", type=Path, help="a file of currents with depths, such as the Ionian's")
    parser.add_argument("--fields", type=int, default=50)
    parser.add_argument("--thinnings", type=int, default=20)
    parser.add_argument("--columns", type=int, default=400)
    parser.add_argument("--measurements", type=int, default=3000)
    parser.add_argument("--only", action="append", help="a part: calibration, dives, prior, vortices, ...")
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    parts: dict[str, Callable[[], dict[str, Any]]] = {
        "calibration": lambda: calibration(options.fields),
        "dives": lambda: by_dives(options.fields),
        "prior": lambda: synthetic(options.fields, "prior"),
        "vortices": lambda: synthetic(options.fields, "vortices"),
        "speed": lambda: speed(options.measurements),
    }
    if options.ionian is not None:
        file = read_currents(options.ionian)
        parts["ionian"] = lambda: thinned_ionian(file, [0.0, 50.0, 200.0, 500.0], options.thinnings)
        parts["ionian_depths"] = lambda: thinned_depths(file, options.columns)
    record: dict[str, Any] = {"machine": f"{platform.machine()}, Python {platform.python_version()}"}
    if options.output is not None and options.output.exists():
        record |= json.loads(options.output.read_text())
    for name, part in parts.items():
        if options.only and name not in options.only:
            continue
        begun = time.perf_counter()
        record[name] = part()
        print(f"{name}: {json.dumps(record[name])}  [{time.perf_counter() - begun:.0f} s]", file=sys.stderr)
        if options.output is not None:
            options.output.write_text(json.dumps(record, indent=1) + "\n")
    print(json.dumps(record, indent=1))


if __name__ == "__main__":
    main()
