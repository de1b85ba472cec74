/* Numbers, and the Taylor coefficients of what a tape of operations computes. */

#include <math.h>
#include <string.h>

#ifdef QUAD
typedef _Float128 real;
extern _Float128 sqrtf128(_Float128), expf128(_Float128), logf128(_Float128), sinf128(_Float128), cosf128(_Float128),
    powf128(_Float128, _Float128), fabsf128(_Float128);
#define SQRT sqrtf128
#define EXP expf128
#define LOG logf128
#define SIN sinf128
#define COS cosf128
#define POW powf128
#define ABS fabsf128
#define PI 3.14159265358979323846264338327950288419716939937510582F128
#define FINE 1e-34F128
#else
typedef long double real;
#define SQRT sqrtl
#define EXP expl
#define LOG logl
#define SIN sinl
#define COS cosl
#define POW powl
#define ABS fabsl
#define PI 3.14159265358979323846264338327950288L
#define FINE 1e-20L
#endif

#define ORDER 64           /* highest order */

typedef struct { int operation, first, second, pad; double value; } Row;

static real convolved(const real *a, const real *b, int k) {
    real sum = 0;
    for (int x = 0; x <= k; x++) sum += a[x] * b[k - x];
    return sum;
}

/* Coefficient k of every row of a tape, from the lower ones. */
static void work_off(const Row *tape, int count, real (*c)[ORDER + 1], char *fixed, int k, const real *in_r,
                     const real *in_s, const real *in_t) {
    for (int x = 0; x < count; x++) {
        const Row *row = &tape[x];
        const real *a = row->first >= 0 ? c[row->first] : 0, *b = row->second >= 0 ? c[row->second] : 0;
        char still_a = a ? fixed[row->first] : 1, still_b = b && row->operation < 11 ? fixed[row->second] : 1;
        if (k == 0) fixed[x] = row->operation == 2 ? 0 : still_a && still_b;
        else if (fixed[x]) { c[x][k] = 0; continue; }
        real sum = 0;
        switch (row->operation) {
        case 0: c[x][k] = row->value; break;
        case 1: c[x][k] = PI; break;
        case 2: c[x][k] = (row->value == 0 ? in_r : row->value == 1 ? in_s : in_t)[k]; break;
        case 3: c[x][k] = a[k] + b[k]; break;
        case 4: c[x][k] = a[k] - b[k]; break;
        case 5: c[x][k] = still_a ? a[0] * b[k] : still_b ? a[k] * b[0] : convolved(a, b, k); break;
        case 6:
            if (still_b) { c[x][k] = a[k] / b[0]; break; }
            for (int y = 0; y < k; y++) sum += c[x][y] * b[k - y];
            c[x][k] = (a[k] - sum) / b[0];
            break;
        case 7:
            if (k == 0) { c[x][0] = SQRT(a[0]); break; }
            for (int y = 1; y < k; y++) sum += c[x][y] * c[x][k - y];
            c[x][k] = (a[k] - sum) / (2 * c[x][0]);
            break;
        case 8:
            if (k == 0) { c[x][0] = EXP(a[0]); break; }
            for (int y = 1; y <= k; y++) sum += y * a[y] * c[x][k - y];
            c[x][k] = sum / k;
            break;
        case 9:
            if (k == 0) { c[x][0] = LOG(a[0]); break; }
            for (int y = 1; y < k; y++) sum += y * c[x][y] * a[k - y];
            c[x][k] = (a[k] - sum / k) / a[0];
            break;
        case 10:
            if (k == 0) { c[x][0] = POW(a[0], (real)row->value); break; }
            for (int y = 0; y < k; y++) sum += ((real)row->value * (k - y) - y) * a[k - y] * c[x][y];
            c[x][k] = sum / (k * a[0]);
            break;
        case 11:
            if (k == 0) { c[x][0] = SIN(a[0]); break; }
            for (int y = 1; y <= k; y++) sum += y * a[y] * b[k - y];
            c[x][k] = sum / k;
            break;
        case 12:
            if (k == 0) { c[x][0] = COS(a[0]); break; }
            for (int y = 1; y <= k; y++) sum += y * a[y] * b[k - y];
            c[x][k] = -sum / k;
            break;
        }
    }
}
