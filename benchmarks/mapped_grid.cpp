// The ceiling of benchmarks/file_legs.py: RK4 on a file's grid, as plainly as the hardware allows, on one core.
// A current (u, v) is read through the map from metres to indices, between levels and times by tables: as
// kernels/flow.py reads it, with the same grid and the same number of lanes.
// g++ -O3 -march=native -ffast-math -fopenmp-simd benchmarks/mapped_grid.cpp -o mapped_grid
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <random>
#include <vector>

constexpr int NX = 101, NY = 101, NZ = 31, NT = 4, LANES = 32, STEPS = 60, FANS = 1000;
constexpr long SJ = 2, SI = SJ * NY, SK = SI * NX, SN = SK * NZ;
using Row = double[LANES];
typedef double Four __attribute__((vector_size(32)));  // (u, v) of two neighbours along j

static inline Four four(const double* g) {
    Four row;
    std::memcpy(&row, g, sizeof row);
    return row;
}

static inline Four lerp(Four low, Four high, double weight) { return low + weight * (high - low); }

struct Axis {  // points, and for even slots the last point at or below their start
    std::vector<double> at;
    std::vector<int> slot;
    double per;
    Axis(double lo, double hi, int count) : at(count), slot(count - 1), per((count - 1) / (hi - lo)) {
        for (int n = 0; n < count; n++) at[n] = lo + n * (hi - lo) / (count - 1);
        for (int n = 0; n < count - 1; n++) slot[n] = n;
    }
};

static inline void cell(const Axis& axis, double at, int& n, double& weight) {
    const int last = (int)axis.at.size() - 1;
    at = std::min(std::max(at, axis.at[0]), axis.at[last]);
    int below = axis.slot[std::min((int)((at - axis.at[0]) * axis.per), last - 1)];
    below = std::min(below + (at >= axis.at[below + 1] ? 1 : 0), last - 1);
    n = below;
    weight = (at - axis.at[below]) / (axis.at[below + 1] - axis.at[below]);
}

static inline double clamped(double at, int count) { return std::min(std::max(at, 0.0), count - 1.000001); }

// the current of all lanes; T: whether the grid has more than one time
template <bool T>
static void velocity(const double* __restrict f, const double* __restrict map, const Axis& levels, const Axis& times,
                     const Row& x, const Row& y, const Row& z, const Row& t, Row& u, Row& v) {
    Row ai, aj;
    #pragma omp simd
    for (int l = 0; l < LANES; l++) {  // bilinear map of 2 x 2 points
        const double p = clamped((x[l] + 600) * (1 / 1200.0), 2), q = clamped((y[l] + 600) * (1 / 1200.0), 2);
        for (int m = 0; m < 2; m++) {
            const double low = map[m] + p * (map[4 + m] - map[m]), high = map[2 + m] + p * (map[6 + m] - map[2 + m]);
            (m ? aj : ai)[l] = low + q * (high - low);
        }
    }
    for (int l = 0; l < LANES; l++) {
        int k, n = 0;
        double c, d = 0;
        cell(levels, z[l], k, c);
        if (T) cell(times, t[l], n, d);
        const double fi = clamped(ai[l], NX), fj = clamped(aj[l], NY);
        const int i = (int)fi, j = (int)fj;
        const double a = fi - i, b = fj - j;
        const double* g = f + n * SN + k * SK + i * SI + j * SJ;
        const auto at = [&](long o) { return T ? lerp(four(g + o), four(g + o + SN), d) : four(g + o); };
        const Four row = lerp(lerp(at(0), at(SK), c), lerp(at(SI), at(SK + SI), c), a);
        u[l] = row[0] + b * (row[2] - row[0]);
        v[l] = row[1] + b * (row[3] - row[1]);
    }
}

template <bool T>
static double rate() {
    std::mt19937_64 rng(0);
    std::uniform_real_distribution<double> speed(-1, 1), place(-450, 450);
    std::vector<double> f(SN * NT), start(2 * FANS);
    for (double& s : f) s = speed(rng);
    for (double& s : start) s = place(rng);
    const double map[8] = {0, 0, 0, NY - 1, NX - 1, 0, NX - 1, NY - 1};
    const Axis levels(-300, 0, NZ), times(0, 300, NT);
    const double h = 5, w = 0.68 * std::sin(-0.49), along = 0.68 * std::cos(-0.49);
    double best = 1e9, sum = 0;
    for (int run = 0; run < 5; run++) {
        const std::clock_t began = std::clock();  // processor time
        for (int e = 0; e < FANS; e++) {
            alignas(64) Row x, y, z, zs, ts, xs, ys, ax, ay, gu, gv, u, v;
            for (int l = 0; l < LANES; l++) {
                x[l] = start[2 * e], y[l] = start[2 * e + 1], z[l] = -100;
                gu[l] = along * std::cos(2 * M_PI * l / LANES), gv[l] = along * std::sin(2 * M_PI * l / LANES);
            }
            for (int step = 0; step < STEPS; step++) {
                const double share[4] = {0, .5, .5, 1}, weight[4] = {1 / 6.0, 1 / 3.0, 1 / 3.0, 1 / 6.0};
                for (int l = 0; l < LANES; l++) xs[l] = ax[l] = x[l], ys[l] = ay[l] = y[l];
                for (int stage = 0; stage < 4; stage++) {
                    for (int l = 0; l < LANES; l++) zs[l] = z[l] + share[stage] * h * w, ts[l] = (step + share[stage]) * h;
                    velocity<T>(f.data(), map, levels, times, xs, ys, zs, ts, u, v);
                    const double next = stage < 3 ? share[stage + 1] * h : 0, part = weight[stage] * h;
                    #pragma omp simd
                    for (int l = 0; l < LANES; l++) {
                        const double du = u[l] + gu[l], dv = v[l] + gv[l];
                        ax[l] += part * du, ay[l] += part * dv;
                        xs[l] = x[l] + next * du, ys[l] = y[l] + next * dv;
                    }
                }
                for (int l = 0; l < LANES; l++) x[l] = ax[l], y[l] = ay[l], z[l] += h * w;
            }
            for (int l = 0; l < LANES; l++) sum += x[l] + y[l];
        }
        best = std::min(best, (double)(std::clock() - began) / CLOCKS_PER_SEC);
    }
    std::fprintf(stderr, "checksum %g\n", sum);
    return (double)FANS * LANES * STEPS * 4 / best;
}

int main() {
    std::printf("{\"four times\": %.5g, \"one time\": %.5g}\n", rate<true>(), rate<false>());
}
