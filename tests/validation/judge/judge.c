/* Taylor integration of the motion of a few agents, with every change of a link located in the Taylor polynomials.

   Compiled once with 80-bit and once (with -DQUAD) with 128-bit floating point numbers. See motion.py for the layout
   of what comes in and goes out. Method: A. Jorba, M. Zou, Experimental Mathematics 14 (2005) 99-117. */

#include "series.h"
#include "roots.h"

#define AGENTS 6
#define PAIRS 15
#define AXES 3
#define GRAPHS 2
#define TERMS 4
#define PIECES 6
#define NODES 160

typedef struct {
    int graph, pieces;                 /* number of its graph; how many formulas, from the smallest distance on */
    int begin[PIECES], count[PIECES];  /* rows of the tape of each formula */
    int force[PIECES], drag[PIECES], energy[PIECES]; /* rows that hold psi'/r, the drag and the energy; -1: none */
    double border[PIECES], longest[PIECES];          /* upper border; how far a pair may move in one step */
    double weight[AGENTS * AGENTS];                  /* w_ij of the drag */
} Term;

typedef struct {
    int agents, axes, order, graphs, terms, frames, leader, pad;
    double shrink, span;
    double enter[GRAPHS], leave[GRAPHS];     /* infinite radii: fixed links */
    int linked[GRAPHS * PAIRS];
    double mass[AGENTS], damping[AGENTS], position_gain[AGENTS], velocity_gain[AGENTS], acceleration_gain[AGENTS];
    int leader_row[AXES], leader_begin, leader_count;
    Term term[TERMS];
} Problem;

typedef struct { double kind, graph, i, j; long double time, speed, bend; } Event; /* kind 0 break, 1 appear, 2 piece */
typedef struct { double kind, graph, i, j; long double time, gap; } Graze;

#define EVENTS 4000
#define GRAZES 64

typedef struct {
    int status, steps, events, grazes;      /* status 0: done, 1: too many events, 2: too many steps, 3: not finite */
    Event event[EVENTS];
    Graze graze[GRAZES];
    long double closest[2][4];              /* linked, unlinked: distance, time, pair */
    long double spread, speed, rise, first_energy, last_energy, time;
} Outcome;

static Problem P;
static const Row *rows;
static real q[AGENTS][AXES][ORDER + 2], p[AGENTS][AXES][ORDER + 2], u[AGENTS][AXES][ORDER + 1];
static real d[PAIRS][AXES][ORDER + 1], v[PAIRS][AXES][ORDER + 1], s[PAIRS][ORDER + 1], root[PAIRS][ORDER + 1];
static real node[PAIRS][TERMS][NODES][ORDER + 1];
static char fixed_node[PAIRS][TERMS][NODES];
static real leader_node[NODES][ORDER + 1], leader_q[AXES][ORDER + 2];
static char leader_fixed[NODES];
static int links[GRAPHS][PAIRS], piece[TERMS][PAIRS], pairs, first_of[PAIRS], second_of[PAIRS];
static char at_radius[GRAPHS][PAIRS], at_border[TERMS][PAIRS][PIECES];

/* Coefficients of the motion about now, up to the order. */
static void expand(real now) {
    int n = P.agents, m = P.axes, K = P.order;
    if (P.leader) {
        real t[ORDER + 1] = {0};
        t[0] = now;
        t[1] = 1;
        for (int k = 0; k <= K; k++) work_off(rows + P.leader_begin, P.leader_count, leader_node, leader_fixed, k, 0, 0, t);
        for (int x = 0; x < m; x++)
            for (int k = 0; k < K; k++) leader_q[x][k + 1] = leader_node[P.leader_row[x]][k] / (k + 1);
    }
    for (int k = 0; k <= K; k++) {
        for (int i = 0; i < n; i++)
            for (int x = 0; x < m; x++) {
                real f = -(real)P.damping[i] * p[i][x][k];
                if (P.leader) {
                    const real *v0 = leader_node[P.leader_row[x]];
                    f -= (real)P.velocity_gain[i] * (p[i][x][k] - v0[k]);
                    f -= (real)P.position_gain[i] * (q[i][x][k] - leader_q[x][k]);
                    if (k < K) f += (real)P.acceleration_gain[i] * (real)P.mass[i] * (k + 1) * v0[k + 1];
                }
                u[i][x][k] = f;
            }
        for (int e = 0; e < pairs; e++) {
            int i = first_of[e], j = second_of[e];
            real sum = 0;
            for (int x = 0; x < m; x++) {
                d[e][x][k] = q[j][x][k] - q[i][x][k];
                v[e][x][k] = p[j][x][k] - p[i][x][k];
            }
            for (int x = 0; x < m; x++) sum += convolved(d[e][x], d[e][x], k);
            s[e][k] = sum;
            int active = 0;
            for (int a = 0; a < P.terms; a++) active |= links[P.term[a].graph][e];
            if (!active) continue;
            if (k == 0) root[e][0] = SQRT(s[e][0]);
            else {
                real rest = 0;
                for (int y = 1; y < k; y++) rest += root[e][y] * root[e][k - y];
                root[e][k] = root[e][0] > 0 ? (s[e][k] - rest) / (2 * root[e][0]) : 0;
            }
            for (int a = 0; a < P.terms; a++) {
                const Term *term = &P.term[a];
                if (!links[term->graph][e]) continue;
                int now_in = piece[a][e];
                work_off(rows + term->begin[now_in], term->count[now_in], node[e][a], fixed_node[e][a], k, root[e], s[e], 0);
                int force = term->force[now_in], drag = term->drag[now_in];
                for (int x = 0; x < m; x++) {
                    if (force >= 0) {
                        const real *c = node[e][a][force];
                        real f = fixed_node[e][a][force] ? c[0] * d[e][x][k] : convolved(c, d[e][x], k);
                        u[i][x][k] += f;
                        u[j][x][k] -= f;
                    }
                    if (drag >= 0) {
                        const real *c = node[e][a][drag];
                        real f = fixed_node[e][a][drag] ? c[0] * v[e][x][k] : convolved(c, v[e][x], k);
                        u[i][x][k] += (real)term->weight[i * AGENTS + j] * f;
                        u[j][x][k] -= (real)term->weight[j * AGENTS + i] * f;
                    }
                }
            }
        }
        for (int i = 0; i < n; i++)
            for (int x = 0; x < m; x++) {
                q[i][x][k + 1] = p[i][x][k] / (k + 1);
                p[i][x][k + 1] = u[i][x][k] / ((real)P.mass[i] * (k + 1));
            }
    }
}

static real step_length(real left) {
    real h = left;
    for (int k = P.order - 2; k <= P.order; k++) {
        real size[2] = {0, 0}, scale[2] = {0, 0};
        for (int i = 0; i < P.agents; i++)
            for (int x = 0; x < P.axes; x++) {
                real a = ABS(q[i][x][k]), b = ABS(p[i][x][k]), a0 = ABS(q[i][x][0]), b0 = ABS(p[i][x][0]);
                if (a > size[0]) size[0] = a;
                if (b > size[1]) size[1] = b;
                if (a0 > scale[0]) scale[0] = a0;
                if (b0 > scale[1]) scale[1] = b0;
            }
        for (int y = 0; y < 2; y++) {
            real wanted = FINE * (scale[y] > (real)0.01 ? scale[y] : (real)0.01);
            if (size[y] > 0) {
                real length = EXP(LOG(wanted / size[y]) / k);
                if (length < h) h = length;
            }
        }
    }
    for (int a = 0; a < P.terms; a++)
        for (int e = 0; e < pairs; e++) {
            if (!links[P.term[a].graph][e]) continue;
            real longest = P.term[a].longest[piece[a][e]], speed = 0, force = 0;
            if (longest <= 0) continue;
            for (int x = 0; x < P.axes; x++) {
                speed += v[e][x][0] * v[e][x][0];
                real bend = v[e][x][1];
                force += bend * bend;
            }
            if (speed > 0 && longest / SQRT(speed) < h) h = longest / SQRT(speed);
            force = SQRT(force);
            if (force > 0 && SQRT(longest / force) < h) h = SQRT(longest / force);
        }
    return h * (real)P.shrink < left ? h * (real)P.shrink : left;
}

static real energy_now(void) {
    real sum = 0;
    for (int i = 0; i < P.agents; i++)
        for (int x = 0; x < P.axes; x++) sum += (real)P.mass[i] * p[i][x][0] * p[i][x][0] / 2;
    for (int a = 0; a < P.terms; a++)
        for (int e = 0; e < pairs; e++)
            if (links[P.term[a].graph][e] && P.term[a].energy[piece[a][e]] >= 0)
                sum += node[e][a][P.term[a].energy[piece[a][e]]][0];
    return sum;
}

/* The formula in force at a distance; one that just meets a border is inside it. */
static void settle_piece(int a, int e, real distance) {
    const Term *term = &P.term[a];
    int x = 0;
    while (x + 1 < term->pieces && distance > (real)term->border[x]) x++;
    piece[a][e] = x;
}

static void look_at_speeds(Outcome *out, real x) {
    real total = 0, mean[AXES] = {0};
    for (int i = 0; i < P.agents; i++) {
        total += P.mass[i];
        for (int y = 0; y < P.axes; y++) mean[y] += (real)P.mass[i] * at(p[i][y], P.order, x);
    }
    for (int i = 0; i < P.agents; i++) {
        real speed = 0, spread = 0;
        for (int y = 0; y < P.axes; y++) {
            real w = at(p[i][y], P.order, x), off = w - mean[y] / total;
            speed += w * w;
            spread += off * off;
        }
        if (SQRT(speed) > out->speed) out->speed = SQRT(speed);
        if (SQRT(spread) > out->spread) out->spread = SQRT(spread);
    }
}

static void note_graze(Outcome *out, int kind, int graph, int e, real time, real gap) {
    int place = out->grazes;
    if (place == GRAZES) {
        for (int k = 0; k < GRAZES; k++)
            if (place == GRAZES ? ABS((real)out->graze[k].gap) > ABS(gap)
                                : fabsl(out->graze[k].gap) > fabsl(out->graze[place].gap))
                place = k;
        if (place == GRAZES) return;
    } else
        out->grazes++;
    out->graze[place] = (Graze){kind, graph, first_of[e], second_of[e], (long double)time, (long double)gap};
}

/* A distance that a pair is watched for crossing. */
typedef struct { int kind, owner, pair, border; real radius; char *mark; int inside; } Surface;

static int surfaces(Surface *found) {
    int count = 0;
    for (int g = 0; g < P.graphs; g++)
        for (int e = 0; e < pairs; e++) {
            double radius = links[g][e] ? P.leave[g] : P.enter[g];
            if (!(radius > 0) || isinf(radius)) continue;
            found[count++] = (Surface){0, g, e, 0, radius, &at_radius[g][e], links[g][e]};
        }
    for (int a = 0; a < P.terms; a++)
        for (int e = 0; e < pairs; e++) {
            if (!links[P.term[a].graph][e]) continue;
            int now_in = piece[a][e];
            if (now_in + 1 < P.term[a].pieces)
                found[count++] = (Surface){1, a, e, now_in, P.term[a].border[now_in], &at_border[a][e][now_in], 1};
            if (now_in > 0)
                found[count++] = (Surface){1, a, e, now_in - 1, P.term[a].border[now_in - 1], &at_border[a][e][now_in - 1], 0};
        }
    return count;
}

static void cross(Outcome *out, const Surface *x, real now, real h) {
    int e = x->pair, kind = 2;
    if (x->kind == 0) {
        kind = links[x->owner][e] ? 0 : 1;
        links[x->owner][e] = !links[x->owner][e];
        for (int a = 0; a < P.terms; a++)
            if (P.term[a].graph == x->owner && links[x->owner][e]) {
                memset(at_border[a][e], 0, PIECES);
                settle_piece(a, e, x->radius);
            }
    } else
        piece[x->owner][e] += x->inside ? 1 : -1;
    /* With hysteresis the pair now is watched for another radius. */
    if (x->kind == 1 || (real)(links[x->owner][e] ? P.leave : P.enter)[x->owner] == x->radius) *x->mark = 1;
    if (out->events < EVENTS) {
        real slope = slope_at(s[e], P.order, h), bend = 0;
        for (int k = P.order; k >= 2; k--) bend = bend * h + (real)k * (k - 1) * s[e][k];
        out->event[out->events] = (Event){kind, x->kind == 0 ? x->owner : P.term[x->owner].graph, first_of[e], second_of[e],
            (long double)now, (long double)(slope / (2 * x->radius)), (long double)(bend / (2 * x->radius))};
    }
    out->events++;
}

static void split(real x, long double *out) {
    out[0] = (long double)x;
    out[1] = (long double)(x - (real)out[0]);
}

/* start: positions, velocities (agents x axes each), then the leader's position (axes), all in pairs of numbers.
   frames: times since the start. states: positions and velocities at each frame and at the end. */
int judge(const Problem *problem, const Row *tape, const long double *start, const long double *frame_times,
          long double *states, Outcome *out) {
    P = *problem;
    rows = tape;
    int n = P.agents, m = P.axes, K = P.order, next_frame = 0;
    memset(out, 0, sizeof *out);
    memset(at_radius, 0, sizeof at_radius);
    memset(at_border, 0, sizeof at_border);
    pairs = 0;
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++) { first_of[pairs] = i; second_of[pairs] = j; pairs++; }
    for (int g = 0; g < P.graphs; g++)
        for (int e = 0; e < pairs; e++) links[g][e] = P.linked[g * PAIRS + e];
    for (int i = 0; i < n; i++)
        for (int x = 0; x < m; x++) {
            q[i][x][0] = start[i * m + x];
            p[i][x][0] = start[n * m + i * m + x];
        }
    for (int x = 0; x < m; x++) leader_q[x][0] = start[2 * n * m + x];
    for (int e = 0; e < pairs; e++) {
        s[e][0] = 0;
        for (int x = 0; x < m; x++) {
            real off = q[second_of[e]][x][0] - q[first_of[e]][x][0];
            s[e][0] += off * off;
        }
        for (int a = 0; a < P.terms; a++) settle_piece(a, e, SQRT(s[e][0]));
    }
    for (int k = 0; k < 2; k++) { out->closest[k][0] = 1e300L; out->closest[k][1] = out->closest[k][2] = out->closest[k][3] = -1; }
    real now = 0, end = P.span, lowest = 0;
    int fresh = 1;
    while (1) {
        expand(now);
        real energy = energy_now(), sound = energy;
        for (int i = 0; i < n; i++)
            for (int y = 0; y < m; y++) sound += q[i][y][K] + p[i][y][K + 1];
        if (!(ABS(sound) < (real)1e300)) { out->status = 3; break; }
        if (fresh == 1 && out->steps == 0) out->first_energy = (long double)energy;
        if (fresh || energy < lowest) lowest = energy;
        if ((long double)(energy - lowest) > out->rise) out->rise = (long double)(energy - lowest);
        fresh = 0;
        out->last_energy = (long double)energy;
        if (now >= end) break;
        if (out->steps++ > 100000) { out->status = 2; break; }
        real h = step_length(end - now), unit[ORDER + 1], x[4 * PAIRS * (TERMS + GRAPHS)], first = 2;
        if (!(h > 0) || !(h <= end)) { out->status = 3; break; }
        Surface watched[4 * PAIRS * (TERMS + GRAPHS)];
        int count = surfaces(watched);
        for (int a = 0; a < count; a++) {
            const Surface *w = &watched[a];
            const real *c = s[w->pair];
            real power = 1;
            patience = 2000;
            int top = K, side = w->inside ? -1 : 1;
            for (int k = 0; k <= K; k++) { unit[k] = c[k] * power; power *= h; }
            unit[0] -= w->radius * w->radius;
            Turn turn = {0, 0, 0};
            if (*w->mark || unit[0] == 0) {
                /* The pair is on the surface now: that root is divided out. */
                for (int k = 0; k < K; k++) unit[k] = unit[k + 1];
                top = K - 1;
                x[a] = first_crossing(unit, top, side, 0, 0);
            } else {
                x[a] = first_crossing(unit, top, side, 0, &turn);
                if (turn.found) {
                    real gap = turn.value / (2 * w->radius);
                    if (ABS(gap) < (real)0.01 * w->radius && turn.where < first)
                        note_graze(out, w->kind, w->kind ? P.term[w->owner].graph : w->owner, w->pair, now + turn.where * h, gap);
                }
            }
            if (x[a] < first) first = x[a];
        }
        real part = first <= 1 ? first : 1, taken = part * h;
        for (int e = 0; e < pairs; e++) {
            int row = links[0][e] ? 0 : 1;
            real best = (real)out->closest[row][0], where = -1, rest = 0, power = 1;
            best = best < (real)1e150 ? best * best : (real)1e300;
            for (int k = 0; k <= K; k++) { unit[k] = s[e][k] * power; power *= taken; if (k) rest += ABS(unit[k]); }
            if (unit[0] - rest > best * (1 + 1e-9)) continue;
            best *= 1 + (real)1e-15;
            patience = 2000;
            smallest(unit, K, 0, 1, 0, &best, &where);
            if (where < 0) continue;
            real sum = 0;
            for (int y = 0; y < m; y++) { real off = at(d[e][y], K, where * taken); sum += off * off; }
            real distance = SQRT(sum);
            if (distance < (real)out->closest[row][0]) {
                out->closest[row][0] = (long double)distance;
                out->closest[row][1] = (long double)(now + where * taken);
                out->closest[row][2] = first_of[e];
                out->closest[row][3] = second_of[e];
            }
        }
        for (int k = 0; k <= 4; k++) look_at_speeds(out, taken * k / 4);
        while (next_frame < P.frames && ((real)frame_times[next_frame] < now + taken || (real)frame_times[next_frame] <= now)) {
            for (int i = 0; i < n; i++)
                for (int y = 0; y < m; y++) {
                    long double *place = states + 2 * ((size_t)next_frame * 2 * n * m + i * m + y);
                    split(at(q[i][y], K, (real)frame_times[next_frame] - now), place);
                    split(at(p[i][y], K, (real)frame_times[next_frame] - now), place + 2 * n * m);
                }
            next_frame++;
        }
        real later = first <= 1 || taken < end - now ? now + taken : end;
        if (taken > 0) {
            memset(at_radius, 0, sizeof at_radius);
            memset(at_border, 0, sizeof at_border);
        }
        if (first <= 1) {
            for (int a = 0; a < count; a++)
                if (x[a] <= first + 4 * FINE) cross(out, &watched[a], later, taken);
            fresh = 1;
            if (out->events > EVENTS / 2) { out->status = 1; break; }
        }
        for (int i = 0; i < n; i++)
            for (int y = 0; y < m; y++) {
                q[i][y][0] = at(q[i][y], K, taken);
                p[i][y][0] = at(p[i][y], K, taken);
                if (!(ABS(q[i][y][0]) < (real)1e100)) out->status = 3;
            }
        for (int y = 0; y < m; y++) leader_q[y][0] = at(leader_q[y], K, taken);
        if (out->status) break;
        now = later;
    }
    out->time = (long double)now;
    while (next_frame <= P.frames) {
        for (int i = 0; i < n; i++)
            for (int y = 0; y < m; y++) {
                long double *place = states + 2 * ((size_t)next_frame * 2 * n * m + i * m + y);
                split(q[i][y][0], place);
                split(p[i][y][0], place + 2 * n * m);
            }
        next_frame++;
    }
    return out->status;
}
