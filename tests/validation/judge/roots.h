/* Values, crossings and smallest values of polynomials on [0, 1]: bounds by the sizes of their coefficients, and
   halving where these decide nothing. */

static real at(const real *c, int K, real x) {
    real sum = c[K];
    for (int k = K - 1; k >= 0; k--) sum = sum * x + c[k];
    return sum;
}

static real slope_at(const real *c, int K, real x) {
    real sum = K * c[K];
    for (int k = K - 1; k >= 1; k--) sum = sum * x + k * c[k];
    return sum;
}

/* Where f, of the sign `side` at low and not at high, becomes zero: bisection, and Newton where it stays inside. */
static real narrowed(const real *c, int K, real low, real high, int side) {
    for (int k = 0; k < 400; k++) {
        real x = (low + high) / 2;
        if (!(x > low && x < high)) break;
        for (int y = 0; y < 2; y++) {
            real f = at(c, K, x);
            if (side * f > 0) low = x; else high = x;
            real g = slope_at(c, K, x);
            if (g == 0) break;
            real next = x - f / g;
            if (!(next > low && next < high)) break;
            x = next;
        }
        if (high - low <= FINE) break;
        /* Newton's side of the bracket is sharp already: close in on it from the other side. */
        real f = at(c, K, x), g = slope_at(c, K, x), reach = 4 * FINE * (1 + ABS(x));
        if (g != 0 && x > low && x < high) {
            real next = x - f / g;
            if (next - reach > low && side * at(c, K, next - reach) > 0) low = next - reach;
            if (next + reach < high && side * at(c, K, next + reach) <= 0) high = next + reach;
        }
    }
    return high;
}

static void moved(const real *c, int K, real *out, real by, real width) {
    real w = 1;
    for (int k = 0; k <= K; k++) out[k] = c[k];
    for (int a = 0; a < K; a++)
        for (int k = K - 1; k >= a; k--) out[k] += by * out[k + 1];
    for (int k = 0; k <= K; k++) { out[k] *= w; w *= width; }
}

typedef struct { real where, value; int found; } Turn;

static int patience; /* halvings left: a polynomial that is rounding alone would be halved for ever */

/* First x in [0, 1] at which side f is no longer positive; 2 when there is none. A turn on the way is noted. */
static real first_crossing(const real *c, int K, int side, int depth, Turn *turn) {
    real rest = 0, bend = 0, third = 0, end = 0, end_slope = 0;
    for (int k = 0; k <= K; k++) {
        end += c[k];
        end_slope += k * c[k];
        if (k >= 1) rest += ABS(c[k]);
        if (k >= 2) bend += k * ABS(c[k]);
        if (k >= 3) third += (real)k * (k - 1) * ABS(c[k]);
    }
    if (side * c[0] <= 0) return 0;
    if (side * c[0] > rest && !(turn && side * c[0] < 3 * rest)) return 2;
    int monotone = ABS(c[1]) > bend;
    int curved = 2 * ABS(c[2]) > third;
    if (!monotone && curved && (c[1] > 0) == (end_slope > 0)) monotone = 1;
    if (monotone) return side * end > 0 ? 2 : narrowed(c, K, 0, 1, side);
    if (curved) {
        real slopes[ORDER + 1];
        for (int k = 0; k < K; k++) slopes[k] = (k + 1) * c[k + 1];
        real x = narrowed(slopes, K - 1, 0, 1, c[1] > 0 ? 1 : -1), f = at(c, K, x);
        if (turn && (!turn->found || ABS(f) < ABS(turn->value))) { turn->found = 1; turn->where = x; turn->value = f; }
        if (side * f <= 0) return narrowed(c, K, 0, x, side);
        return side * end > 0 ? 2 : narrowed(c, K, x, 1, side);
    }
    if (depth > 60 || patience-- < 0) return side * end > 0 ? 2 : 1;
    real half[ORDER + 1];
    Turn inner = {0, 0, 0};
    for (int part = 0; part < 2; part++) {
        moved(c, K, half, part * (real)0.5, (real)0.5);
        inner.found = 0;
        real x = first_crossing(half, K, side, depth + 1, turn ? &inner : 0);
        if (turn && inner.found && (!turn->found || ABS(inner.value) < ABS(turn->value))) {
            *turn = inner;
            turn->where = (part + inner.where) / 2;
        }
        if (x <= 1) return (part + x) / 2;
    }
    return 2;
}

/* Smallest value of the polynomial on [0, high]; where in *x. */
static void smallest(const real *c, int K, real low, real high, int depth, real *best, real *x) {
    real part[ORDER + 1], rest = 0, bend = 0, third = 0;
    moved(c, K, part, low, high - low);
    const real ends[2] = {at(c, K, low), at(c, K, high)};
    for (int k = 0; k < 2; k++) if (ends[k] < *best) { *best = ends[k]; *x = k ? high : low; }
    for (int k = 1; k <= K; k++) {
        rest += ABS(part[k]);
        if (k >= 2) bend += k * ABS(part[k]);
        if (k >= 3) third += (real)k * (k - 1) * ABS(part[k]);
    }
    if (part[0] - rest >= *best - 8 * FINE * ABS(*best) || ABS(part[1]) > bend) return;
    if (2 * ABS(part[2]) > third || depth > 40 || patience-- < 0) {
        if (part[2] <= 0 || part[1] >= 0) return;
        real slopes[ORDER + 1] = {0};
        for (int k = 0; k < K; k++) slopes[k] = (k + 1) * part[k + 1];
        if (at(slopes, K - 1, 1) <= 0) return;
        real y = narrowed(slopes, K - 1, 0, 1, -1), f = at(part, K, y);
        if (f < *best) { *best = f; *x = low + y * (high - low); }
        return;
    }
    smallest(c, K, low, (low + high) / 2, depth + 1, best, x);
    smallest(c, K, (low + high) / 2, high, depth + 1, best, x);
}
