/* The friction limit in C: what the compiled kernels are measured against.
 *
 * Line by line the algorithm of daemon/slipd/fusion/limit, under the same names. Units, derivations and the
 * rounding bounds stand there; comments here say only what differs:
 *
 *   - sums are taken in the order written (the kernels allow any order in their passes over the taxels);
 *   - several results are a struct;
 *   - all working memory is one block for the whole batch.
 *
 *   cc -std=c99 -O3 -ffp-contract=off -shared -fPIC -o limit.so limit.c -lm
 *
 * No fast-math. Without -ffp-contract=off a compiler may fuse a product into the sum after it wherever the processor
 * can, and `one_minus_rho` would lose the errors it collects.
 */
#include <math.h>
#include <stdlib.h>

enum { INTERIOR, HINGE, TRANSLATING, NONE };
enum { OPEN, MET, MET_AT_KINK };
enum { MAX_PASSES = 120, PATIENCE = 14, MAX_STOOD = 8, ROWS = 11 }; /* rows: of working memory, see `contact_in` */

static const double U = 0x1p-53, FAR = 1e9, GOAL = 2e-13, GOAL_SLACKS = 30.0, RESOLUTION = 1e-13, TINY = 1e-150;
static const double SMALLEST = 1e-130, LARGEST = 1e130, RIDGE = 1e-28, FLAT = 1e-9, STIFF = 1e-12;
static const double OVERSHOOT = 0.5, KINK = 0.1, FELT = 0.25, UNSURE = 4e-3, SOFTEST = 0.1, FOLLOW = 0.1;
static const double ARMIJO = 1e-4, STANDS = 1e-12, BESIDE = 1e-9, RULING = 0.5, NEAR_TRANSLATION = 0.02, ASKEW = 20.0;
static const double SPLIT = 134217729.0;

typedef struct {
    double value, gx, gy, gm, hxx, hxy, hxm, hyy, hym, hmm, bend, gross;
} Sweep;

typedef struct {
    double x, y, m, gross; /* 1 − Σ t_x, Σ t_y, spin, Σ |t_y| */
} Field;

typedef struct {
    double x, y, m;
} Twist;

typedef struct {
    double h, dh, ax, am;
    int gauge;
} Plane;

typedef struct {
    double g1, g2, h11, h12, h22;
} Model;

typedef struct {
    double s1, s2, inverse;
    int bends;
} Step;

typedef struct {
    double lower, upper, value, turn; /* turn: angular velocity about a hinge */
    int state;
    long hinge;
} Found;

typedef struct {
    long n;
    double *x, *y, *loads;           /* as given, active taxels only */
    double *xs, *ys, *w;             /* positions and weights in the units of the contact */
    double *px, *py;                 /* positions seen from a taxel */
    double *less, *ty;               /* friction field */
    double *others;                  /* weights without the hinge's */
    double total, cx, cy, ex, ey, mean; /* what `normalise` finds */
    double ct, st;
} Contact;

static double larger(double a, double b) { return b > a ? b : a; }   /* a where b is not a number, */
static double smaller(double a, double b) { return b < a ? b : a; }  /* as Python's max and min */

static Sweep sweep(long n, const double *x, const double *y, const double *w, const double *px, const double *py,
                   double vx, double vy, double om) {
    Sweep r = {0};
    for (long i = 0; i < n; i++) {
        double ux = vx - om * py[i], uy = vy + om * px[i];
        double d = sqrt(ux * ux + uy * uy) + TINY, both = d + fabs(ux), under = 1.0 / (d * both);
        double inverse = both * under, c = ux > 0.0 ? uy * uy * (d * under) : d - ux;
        double nx = ux * inverse, ny = uy * inverse, k = w[i] * inverse;
        double share = d > TINY ? c * inverse : 1.0;
        double arm = x[i] * nx + y[i] * ny;
        r.value += w[i] * c;
        r.gx += w[i] * share;
        r.gy += w[i] * ny;
        r.gross += fabs(w[i] * ny);
        r.gm += w[i] * (x[i] * ny + y[i] * share);
        r.hxx += k * ny * ny;
        r.hxy -= k * nx * ny;
        r.hyy += k * nx * nx;
        r.hxm -= k * ny * arm;
        r.hym += k * nx * arm;
        r.hmm += k * arm * arm;
        r.bend += k * k;
    }
    return r;
}

static Sweep path_sweep(const Contact *t, double vx, double vy, double om, double soft, Field *field) {
    Sweep r = {0};
    Field f = {0};
    const double *x = t->xs, *y = t->ys, *w = t->w;
    for (long i = 0; i < t->n; i++) {
        double ux = vx - om * t->py[i], uy = vy + om * t->px[i], less = t->less[i], ty = t->ty[i];
        double side = uy * uy + soft, d = sqrt(ux * ux + side), inverse = 1.0 / d;
        double beside = side / (d + fabs(ux));
        double lack = ux > 0.0 ? beside : d - ux;
        double nx = ux * inverse, ny = uy * inverse, k = w[i] * inverse, share = lack * inverse;
        r.value += w[i] * lack;
        r.gx += w[i] * share;
        r.gy += w[i] * ny;
        r.gross += fabs(w[i] * ny);
        r.gm += w[i] * (x[i] * ny + y[i] * share);
        f.x += w[i] * less;
        f.y += w[i] * ty;
        f.gross += fabs(w[i] * ty);
        f.m += w[i] * (x[i] * ty + y[i] * less);
        double tx = 1.0 - less;
        double a = k * (less + tx * share), b = -0.5 * k * (tx * ny + ty * nx), c = k * (1.0 - ty * ny);
        r.hxx += a;
        r.hxy += b;
        r.hyy += c;
        r.hxm += x[i] * b - y[i] * a;
        r.hym += x[i] * c - y[i] * b;
        r.hmm += x[i] * x[i] * c - 2.0 * x[i] * y[i] * b + y[i] * y[i] * a;
        r.bend += k * k;
    }
    *field = f;
    return r;
}

static void cut(double *less, double *ty) {
    double over = *ty * *ty + *less * *less - 2.0 * *less;
    if (!(over > 0.0)) return;
    double size = sqrt(1.0 + over);
    *less = (over / (1.0 + size) + *less) / size;
    *ty /= size;
}

static void update_field(Contact *t, double vx, double vy, double om, double soft, double sx, double sy, double sm) {
    for (long i = 0; i < t->n; i++) {
        double ux = vx - om * t->py[i], uy = vy + om * t->px[i];
        double side = uy * uy + soft, d = sqrt(ux * ux + side), nx = ux / d, ny = uy / d;
        double share = (ux > 0.0 ? side / (d + fabs(ux)) : d - ux) / d;
        double dx = sx - sm * t->py[i], dy = sy + sm * t->px[i], along = nx * dx + ny * dy;
        double less = share - (dx - (1.0 - t->less[i]) * along) / d, ty = ny + (dy - t->ty[i] * along) / d;
        cut(&less, &ty);
        t->less[i] = less;
        t->ty[i] = ty;
    }
}

static double soft_sum(const Contact *t, double vx, double vy, double om, double soft) {
    double value = 0.0;
    for (long i = 0; i < t->n; i++) {
        double ux = vx - om * t->py[i], uy = vy + om * t->px[i];
        double side = uy * uy + soft, d = sqrt(ux * ux + side);
        value += t->w[i] * (ux > 0.0 ? side / (d + fabs(ux)) : d - ux);
    }
    return value;
}

static long sharpest(long n, const double *x, const double *y, const double *w, double vx, double vy, double om) {
    double weight = 0.0, square = 1.0;
    long j = 0;
    for (long i = 0; i < n; i++) {
        double ux = vx - om * y[i], uy = vy + om * x[i], wi = w[i] * w[i], ui = ux * ux + uy * uy;
        if (wi * square > weight * ui) {
            j = i;
            weight = wi;
            square = ui;
        }
    }
    return j;
}

static Model plane_model(const Sweep *r, const Plane *p) {
    double ax = p->ax, am = p->am;
    double h11 = ax * ax * r->hxx + 2.0 * ax * am * r->hxm + am * am * r->hmm, h22 = r->hyy;
    double ridge = RIDGE * (h11 + h22) + 1e-300;
    return (Model){ax * (p->h - r->gx) + am * r->gm, r->gy, h11 + ridge, ax * r->hxy + am * r->hym, h22 + ridge};
}

static Step newton_step(const Model *m) {
    double h11 = m->h11, h12 = m->h12, h22 = m->h22;
    int bends = h11 * h22 - h12 * h12 > FLAT * h11 * h22;
    if (!bends) {
        double more = STIFF * (h11 + h22);
        h11 += more;
        h22 += more;
    }
    double inverse = 1.0 / (h11 * h22 - h12 * h12);
    return (Step){(h12 * m->g2 - h22 * m->g1) * inverse, (h12 * m->g1 - h11 * m->g2) * inverse, inverse, bends};
}

static Step norm_step(const Model *m, double power, double pull) {
    Step s = newton_step(m);
    double k1 = m->h22 * pull * s.inverse, k2 = -m->h12 * pull * s.inverse;
    double bb = pull * k1 / power, be = -pull * s.s1 / power, ee = -(m->g1 * s.s1 + m->g2 * s.s2) / power;
    double square = (1.0 + be) * (1.0 + be) + (1.0 - bb) * ee;
    if (square > 0.0) {
        double z = ee / ((1.0 + be) + sqrt(square)), shorten = 1.0 + be + ee - (bb + be) * z;
        if (shorten > 0.0) {
            s.s1 = (s.s1 + z * k1) / shorten;
            s.s2 = (s.s2 + z * k2) / shorten;
        }
    }
    return s;
}

static double rounding(const Sweep *r, double h, double vx, double speed, double om, double slack) {
    return slack * (r->value + fabs(h * vx) + fabs(om)) + 16.0 * U * (speed * (r->gx + r->gross) + fabs(om));
}

static double spin_lower(const Field *f, double h, double dh, double slack) {
    double missing = sqrt((f->x - h) * (f->x - h) + f->y * f->y) + slack * (f->x + f->gross + h) + dh;
    double room = f->x * (2.0 - f->x) - f->y * f->y - 4.0 * slack * f->x;
    double share = room > 0.0 ? smaller(missing * (1.0 + sqrt(1.0 + room)) / room, 1.0) : 1.0;
    return larger((1.0 - share) * f->m, 0.0) - 3.0 * slack - 16.0 * U;
}

static double gauge_upper(const Field *f, double lx, double lm, double slack) {
    double fx = 1.0 - f->x, along = fx * lx + f->m * lm, apart = fabs(lx) + 2.0 * fabs(lm);
    if (!(along > 0.0)) return apart;
    double off = along * lx - fx, a = sqrt(off * off + f->y * f->y) + slack * (f->x + f->gross);
    double upper = (1.0 + a + 2.0 * (fabs(along * lm - f->m) + 3.0 * slack)) / along;
    return smaller(upper, apart) * (1.0 + 16.0 * U);
}

static Found bounds(const Sweep *r, const Field *f, double vx, double speed, double om, const Plane *p, double slack) {
    double value = r->value + p->h * vx, error = rounding(r, p->h, vx, speed, om, slack);
    Found found = {.hinge = -1};
    if (p->gauge) {
        double along = p->am * vx - p->ax * om;
        found.lower = along / (value + error) * (1.0 - 8.0 * U);
        found.upper = gauge_upper(f, p->am, -p->ax, slack);
        found.value = along / value;
    } else {
        found.lower = spin_lower(f, p->h, p->dh, slack);
        found.upper = value + error + p->dh * fabs(vx);
        found.value = value;
    }
    return found;
}

static void tighten(Found *found, const Found *by) {
    found->lower = larger(found->lower, by->lower);
    found->upper = smaller(found->upper, by->upper);
}

static Found descend(const Contact *t, Twist *q, const Plane *p, double goal, int passes, int *done) {
    long n = t->n;
    const double *x = t->xs, *y = t->ys, *w = t->w;
    double h = p->h, ax = p->ax, am = p->am, slack = (double)(n + 16) * U, last_fall = INFINITY;
    Found found = {.lower = -INFINITY, .upper = INFINITY, .state = OPEN, .hinge = -1};
    Sweep r = sweep(n, x, y, w, x, y, q->x, q->y, q->m);
    for (*done = 1;;) {
        Field f = {r.gx, r.gy, r.gm, r.gross};
        Found now = bounds(&r, &f, q->x, fabs(q->x) + fabs(q->y), q->m, p, slack);
        tighten(&found, &now);
        found.value = now.value;
        double curvature = r.hxx + r.hyy;
        if (found.upper - found.lower <= goal * (p->gauge ? found.upper : 1.0)) {
            found.state = r.bend > RULING * curvature * curvature ? MET_AT_KINK : MET;
            return found;
        }
        if (*done >= passes) return found;
        Model m = plane_model(&r, p);
        Step s = norm_step(&m, r.value + q->x, (1.0 - h) * ax);
        double size = fabs(q->x) + fabs(q->y) + fabs(q->m);
        if (!s.bends || r.bend > KINK * curvature * curvature) {
            long j = sharpest(n, x, y, w, q->x, q->y, q->m);
            double near = fabs(q->x - q->m * y[j]) + fabs(q->y + q->m * x[j]);
            double change = fabs((ax - am * y[j]) * s.s1) + fabs(am * x[j] * s.s1 + s.s2);
            if (!s.bends || change > FELT * near || near < UNSURE * w[j] * size) return found;
        }
        double value = r.value + h * q->x, slope = m.g1 * s.s1 + m.g2 * s.s2, shrink = 1.0;
        int resolved = -slope > RESOLUTION * fabs(value);
        Twist next;
        for (;;) {
            if (*done >= passes) return found;
            next = (Twist){q->x + shrink * s.s1 * ax, q->y + shrink * s.s2, q->m + shrink * s.s1 * am};
            r = sweep(n, x, y, w, x, y, next.x, next.y, next.m);
            ++*done;
            double end = (ax * (h - r.gx) + am * r.gm) * s.s1 + r.gy * s.s2;
            if (resolved && r.value + h * next.x < value && end <= -OVERSHOOT * slope) break;
            if (!resolved && -slope < 0.25 * last_fall) break;
            if (!resolved || *done > PATIENCE) return found;
            shrink *= end > 0.0 ? smaller(larger(slope / (slope - end), 0.1), 0.7) : 0.5;
        }
        *q = next;
        last_fall = -slope;
    }
}

static void place_about(Contact *t, long j) {
    for (long i = 0; i < t->n; i++) {
        double dx = (t->x[i] - t->x[j]) / t->mean, dy = (t->y[i] - t->y[j]) / t->mean;
        t->px[i] = t->ct * dx + t->st * dy;
        t->py[i] = t->ct * dy - t->st * dx;
    }
}

static Found hinge_bounds(Contact *t, double cx, double cy, const Plane *p, double slack) {
    double arm = p->gauge ? -p->ax - p->am * cy : 1.0;
    if (fabs(arm) < 1e-6) return (Found){.lower = NAN, .upper = NAN, .value = NAN, .turn = NAN, .hinge = -1};
    double om = 1.0 / arm, out = 0.0, less, ty;
    for (long i = 0; i < t->n; i++) {
        t->others[i] = t->w[i];
        if (t->px[i] == 0.0 && t->py[i] == 0.0) {
            out += t->others[i];
            t->others[i] = 0.0;
        }
    }
    Sweep r = sweep(t->n, t->xs, t->ys, t->others, t->px, t->py, 0.0, 0.0, om);
    double gm = r.gm - out * cy;
    if (p->gauge) {
        double fx = (1.0 - out) - r.gx, fy = r.gy;
        double along = (gm + cx * fy - cy * fx) / arm;
        less = 1.0 - (along * p->am - fx) / out;
        ty = -fy / out;
    } else {
        less = (p->h - r.gx) / out;
        ty = -r.gy / out;
    }
    cut(&less, &ty);
    Field f = {r.gx + out * less, r.gy + out * ty, gm + out * (cy * (1.0 - less) - cx * ty), r.gross + fabs(out * ty)};
    Found found = bounds(&r, &f, -om * cy, fabs(om * cx) + fabs(om * cy), om, p, slack);
    found.turn = om;
    return found;
}

static Found follow_path(Contact *t, Twist *q, const Plane *p, double goal, Found found, int steps) {
    double h = p->h, ax = p->ax, am = p->am, slack = (double)(t->n + 16) * U;
    for (long i = 0; i < t->n; i++) {
        t->less[i] = t->ty[i] = 0.0;
        t->px[i] = t->xs[i];
        t->py[i] = t->ys[i];
    }
    long origin = -1;
    double cx = 0.0, cy = 0.0, ox = q->x, oy = q->y, om = q->m, last_gap = INFINITY, scale = 1.0;
    double soft = SOFTEST * (fabs(ox) + fabs(oy) + fabs(om));
    found.value = NAN;
    for (int step = 0, stood = 0; step < steps; step++) {
        long j = sharpest(t->n, t->px, t->py, t->w, ox, oy, om);
        if (j != origin) {
            double vx = ox - om * t->py[j], vy = oy + om * t->px[j];
            ox = vx, oy = vy, cx = -t->xs[j], cy = -t->ys[j], origin = j;
            place_about(t, j);
        }
        if (step == 0) update_field(t, ox, oy, om, soft * soft, 0.0, 0.0, 0.0);
        Field f;
        Sweep r = path_sweep(t, ox, oy, om, soft * soft, &f);
        double vx = ox - om * cy, vy = oy + om * cx;
        Found now = bounds(&r, &f, vx, fabs(vx) + fabs(vy) + fabs(ox) + fabs(oy), om, p, slack);
        tighten(&found, &now);
        found.value = now.value;
        double gap = now.upper - now.lower;
        if (p->gauge) gap /= now.lower * now.upper;
        scale = p->gauge ? found.upper : 1.0;
        if (found.upper - found.lower <= goal * scale) break;
        double curvature = r.hxx + r.hyy;
        if (r.bend > RULING * curvature * curvature) {
            Found at = hinge_bounds(t, cx, cy, p, slack);
            tighten(&found, &at);
            if (found.upper - found.lower <= goal * scale) {
                *q = (Twist){-at.turn * cy, at.turn * cx, at.turn};
                found.value = at.value;
                found.hinge = origin;
                return found;
            }
        }
        Model m = plane_model(&r, p);
        Step s = newton_step(&m);
        double sx = (ax + am * cy) * s.s1, sy = -am * cx * s.s1 + s.s2, sm = am * s.s1;
        update_field(t, ox, oy, om, soft * soft, sx, sy, sm);
        double value = r.value + h * vx, slope = m.g1 * s.s1 + m.g2 * s.s2, shrink = 1.0, nx, ny, nm;
        for (;; shrink *= 0.3) {
            nx = ox + shrink * sx, ny = oy + shrink * sy, nm = om + shrink * sm;
            double next_value = soft_sum(t, nx, ny, nm, soft * soft) + h * (nx - nm * cy);
            if (next_value <= value + ARMIJO * shrink * slope + RESOLUTION * fabs(value) || shrink < RESOLUTION) break;
        }
        ox = nx, oy = ny, om = nm;
        if (shrink == 1.0) {
            double next_soft = smaller(soft, larger(FOLLOW * soft, FOLLOW * gap));
            double moved = fabs(sx) + fabs(sy) + fabs(sm);
            int still = next_soft == soft && moved <= STANDS * (fabs(ox) + fabs(oy) + soft) && gap >= 0.5 * last_gap;
            stood = still ? stood + 1 : 0;
            if (stood == MAX_STOOD) break;
            soft = next_soft;
        }
        last_gap = gap;
    }
    *q = (Twist){ox - om * cy, oy + om * cx, om};
    if (fabs(ox) + fabs(oy) <= BESIDE * (fabs(ox) + fabs(oy) + fabs(om))) {
        Found at = hinge_bounds(t, cx, cy, p, slack);
        if (found.upper - at.lower <= goal * scale && at.upper - found.lower <= goal * scale) {
            tighten(&found, &at);
            found.value = at.value;
            found.hinge = origin;
        }
    }
    return found;
}

static Found minimise(Contact *t, Twist *q, const Plane *p) {
    double goal = larger(GOAL, GOAL_SLACKS * (double)(t->n + 16) * U);
    int done;
    Found found = descend(t, q, p, goal, MAX_PASSES, &done);
    if (found.state == MET_AT_KINK) {
        long j = sharpest(t->n, t->xs, t->ys, t->w, q->x, q->y, q->m);
        double near = fabs(q->x - q->m * t->ys[j]) + fabs(q->y + q->m * t->xs[j]);
        if (near <= BESIDE * (fabs(q->x) + fabs(q->y) + fabs(q->m))) found.hinge = j;
    } else if (found.state == OPEN && done < MAX_PASSES) {
        found = follow_path(t, q, p, goal, found, MAX_PASSES - done);
    }
    found.value = smaller(larger(found.value, found.lower), found.upper);
    return found;
}

typedef struct {
    double total, mx, my, negative;
} Moments;

static Moments moments(const Contact *t, double ox, double oy) {
    Moments m = {0};
    for (long i = 0; i < t->n; i++) {
        m.total += t->loads[i];
        m.mx += t->loads[i] * (t->x[i] - ox);
        m.my += t->loads[i] * (t->y[i] - oy);
        m.negative += t->loads[i] < 0.0 ? 1.0 : 0.0;
    }
    return m;
}

/* Returns Σ w |ρ|. */
static double place(Contact *t, double scale, double *blocks) {
    double mean = 0.0, sum = 0.0;
    for (long i = 0; i < t->n; i++) {
        double dx = (t->x[i] - t->cx) - t->ex, dy = (t->y[i] - t->cy) - t->ey, w = t->loads[i] * scale;
        t->xs[i] = t->ct * dx + t->st * dy;
        t->ys[i] = t->ct * dy - t->st * dx;
        t->w[i] = w;
        mean += w * sqrt(dx * dx + dy * dy);
        sum += w * (fabs(dx) + fabs(dy));
    }
    *blocks = sum;
    return mean;
}

static void normalise(Contact *t, double fx, double fy) {
    t->total = 0.0, t->cx = t->cy = NAN, t->ex = t->ey = t->mean = 0.0;
    if (t->n == 0) return;
    Moments m = moments(t, t->x[0], t->y[0]);
    t->total = NAN;
    if (m.negative > 0.0 || !isfinite(m.total + m.mx + m.my) || m.total > LARGEST) return;
    if (0.0 < m.total && m.total < SMALLEST) return;
    t->total = m.total;
    if (m.total == 0.0) return;
    double size = hypot(fx, fy);
    t->ct = size > 0.0 ? fx / size : 1.0;
    t->st = size > 0.0 ? fy / size : 0.0;
    t->cx = t->x[0] + m.mx / m.total;
    t->cy = t->y[0] + m.my / m.total;
    Moments lack = moments(t, t->cx, t->cy);
    t->ex = lack.mx / m.total;
    t->ey = lack.my / m.total;
    double blocks, mean = place(t, 1.0 / m.total, &blocks);
    if (blocks == 0.0) return;
    if (!(SMALLEST < mean && mean < LARGEST)) {
        t->total = NAN;
        return;
    }
    double inverse = 1.0 / mean;
    t->mean = mean;
    for (long i = 0; i < t->n; i++) {
        t->xs[i] *= inverse;
        t->ys[i] *= inverse;
    }
}

static double product_error(double a, double b, double p) {
    double t = SPLIT * a, ah = t - (t - a), al = a - ah;
    t = SPLIT * b;
    double bh = t - (t - b), bl = b - bh;
    return ((ah * bh - p) + ah * bl + al * bh) + al * bl;
}

static double sum_error(double a, double b, double s) {
    double t = s - a;
    return (a - (s - t)) + (b - t);
}

static double one_minus_rho(const Contact *t, double mu, double fx, double fy) {
    double high = 0.0, low = 0.0;
    for (long i = 0; i < t->n; i++) {
        double s = high + t->loads[i];
        low += sum_error(high, t->loads[i], s);
        high = s;
    }
    double p = mu * high, tail = product_error(mu, high, p) + mu * low, w = p + tail;
    tail -= w - p;
    double a = w * w, b = fx * fx, c = fy * fy, d = a - b, e = d - c;
    double errors = product_error(w, w, a) + 2.0 * w * tail - product_error(fx, fx, b) - product_error(fy, fy, c);
    errors += sum_error(a, -b, d) + sum_error(d, -c, e);
    return (e + errors) / (w * (w + sqrt(b + c)));
}

static double slack_of_room(const Contact *t, double mu, double fx, double fy, double grip, double *dh) {
    double h = 1.0 - hypot(fx, fy) / grip, spread = (double)(t->n + 16) * U;
    *dh = (double)(t->n + 4) * U;
    if (h >= NEAR_TRANSLATION) return h;
    h = one_minus_rho(t, mu, fx, fy);
    *dh = 16.0 * U * fabs(h) + 4.0 * spread * spread;
    return h;
}

static double disc_lean(double rho) { return 1.5 - 0.75 * rho * rho; }

static int answer(double *out, double value, double lower, double upper, double px, double py, int kind) {
    out[0] = value, out[1] = lower, out[2] = upper, out[3] = px, out[4] = py;
    return kind;
}

static int torque_limit_in(Contact *t, double mu, const double *f, const double *about, int sense, double *out) {
    double fx = f[0], fy = f[1];
    normalise(t, sense * fx, sense * fy);
    if (!(t->total > 0.0) || !isfinite(fx + fy + about[0] + about[1])) return answer(out, NAN, NAN, NAN, NAN, NAN, NONE);
    double grip = mu * t->total, force = hypot(fx, fy), dh;
    double dx = (about[0] - t->cx) - t->ex, dy = (about[1] - t->cy) - t->ey;
    double shift = -sense * (dx * fy - dy * fx);
    double slack = (8.0 * U * (fabs(dx) + fabs(dy)) + (double)(t->n + 16) * U * t->mean) * force;
    double h = slack_of_room(t, mu, fx, fy, grip, &dh);
    if (h < 0.0) return answer(out, NAN, NAN, NAN, NAN, NAN, TRANSLATING);
    if (h == 0.0) return answer(out, shift, shift - slack, shift + slack, NAN, NAN, TRANSLATING);
    if (t->mean == 0.0) return answer(out, shift, shift - slack, shift + slack, t->cx + t->ex, t->cy + t->ey, HINGE);
    Twist q = {disc_lean(1.0 - h) * (1.0 - h) / sqrt(h * (2.0 - h)), 0.0, 1.0};
    Plane p = {h, dh, 1.0, 0.0, 0};
    Found found = minimise(t, &q, &p);
    double unit = grip * t->mean, lower = unit * found.lower + shift, upper = unit * found.upper + shift;
    double value = unit * found.value + shift;
    slack += 8.0 * U * (fabs(lower) + fabs(upper));
    if (found.hinge >= 0)
        return answer(out, value, lower - slack, upper + slack, t->x[found.hinge], t->y[found.hinge], HINGE);
    double px = t->cx + (t->ex - t->mean * (t->ct * q.y + t->st * q.x));
    double py = t->cy + (t->ey + t->mean * (t->ct * q.x - t->st * q.y));
    return answer(out, value, lower - slack, upper + slack, px, py, INTERIOR);
}

static Found unit_gauge(Contact *t, Twist *q, double f, double s) {
    double size = hypot(f, s), lx = f / size, lm = s / size;
    double power = lx * q->x + lm * q->m, length = fabs(q->x) + fabs(q->y) + fabs(q->m);
    if (0.0 < length && length <= ASKEW * power && ASKEW * power < INFINITY) {
        *q = (Twist){q->x / power, q->y / power, q->m / power};
    } else {
        double lean = disc_lean(lx);
        power = lean * lx * lx + lm * lm;
        *q = (Twist){lean * lx / power, 0.0, lm / power};
    }
    Plane p = {1.0, 0.0, -lm, lx, 1};
    Found found = minimise(t, q, &p);
    found.lower *= size * (1.0 - 8.0 * U);
    found.upper *= size * (1.0 + 8.0 * U);
    found.value *= size;
    return found;
}

/* start: of the frame before; on return the twist found. */
static int utilisation_in(Contact *t, double mu, const double *f, double m, const double *about, Twist *start,
                          double *out) {
    double fx = f[0], fy = f[1], force = hypot(fx, fy);
    Twist from = *start;
    *start = (Twist){NAN, NAN, NAN};
    normalise(t, fx, fy);
    if (isnan(t->total) || !isfinite(fx + fy + m + about[0] + about[1]))
        return answer(out, NAN, NAN, NAN, NAN, NAN, NONE);
    if (force == 0.0 && m == 0.0) return answer(out, 0.0, 0.0, 0.0, NAN, NAN, NONE);
    if (t->total == 0.0) return answer(out, INFINITY, INFINITY, INFINITY, NAN, NAN, NONE);
    double grip = mu * t->total, ct = t->ct, st = t->st, mean = t->mean;
    double dx = (about[0] - t->cx) - t->ex, dy = (about[1] - t->cy) - t->ey, spin = m + (dx * fy - dy * fx);
    if (mean == 0.0 && spin != 0.0) {
        double turn = copysign(1.0, spin);
        *start = (Twist){-turn * dy, turn * dx, turn};
        return answer(out, INFINITY, INFINITY, INFINITY, t->cx + t->ex, t->cy + t->ey, HINGE);
    }
    if (mean == 0.0) {
        double ratio = force / grip;
        *start = (Twist){ct, st, 0.0};
        return answer(out, ratio, ratio * (1.0 - 8.0 * U), ratio * (1.0 + 8.0 * U), NAN, NAN, TRANSLATING);
    }
    double vx = (from.x + from.m * dy) / mean, vy = (from.y - from.m * dx) / mean;
    Twist q = {ct * vx + st * vy, ct * vy - st * vx, from.m};
    Found found = unit_gauge(t, &q, force / grip, spin / (grip * mean));
    double slack = 16.0 * U * ((fabs(dx) + fabs(dy)) * force + fabs(m)) / (grip * mean);
    slack += 2.0 * (double)(t->n + 16) * U * force / grip;
    double lower = larger(found.lower - slack, 0.0), upper = found.upper + slack;
    vx = mean * (ct * q.x - st * q.y), vy = mean * (st * q.x + ct * q.y);
    *start = (Twist){vx - q.m * dy, vy + q.m * dx, q.m};
    if (fabs(q.m) * FAR <= sqrt(q.x * q.x + q.y * q.y))
        return answer(out, found.value, lower, upper, NAN, NAN, TRANSLATING);
    if (found.hinge >= 0) return answer(out, found.value, lower, upper, t->x[found.hinge], t->y[found.hinge], HINGE);
    return answer(out, found.value, lower, upper, t->cx + (t->ex - vy / q.m), t->cy + (t->ey + vx / q.m), INTERIOR);
}

static Contact contact_in(double *memory, long n) {
    double *row[ROWS];
    for (int i = 0; i < ROWS; i++) row[i] = memory + i * n;
    return (Contact){.x = row[0], .y = row[1], .loads = row[2], .xs = row[3], .ys = row[4], .w = row[5], .px = row[6],
                     .py = row[7], .less = row[8], .ty = row[9], .others = row[10], .ct = 1.0};
}

static void gather(Contact *t, long n, const double *x, const double *y, const double *loads) {
    t->n = 0;
    for (long i = 0; i < n; i++) {
        t->x[t->n] = x[i], t->y[t->n] = y[i], t->loads[t->n] = loads[i];
        t->n += loads[i] != 0.0;
    }
}

/* x, y: (n), shared by all frames; loads: (frames, n); tangential, about: (frames, 2).
 * out: (frames, 6): torque, lower and upper bound, pole (2), kind. Left as it is where memory is short. */
void torque_limits(long frames, long n, const double *x, const double *y, const double *loads, double mu,
                   const double *tangential, const double *about, int sense, double *out) {
    double *memory = malloc(sizeof(double) * ROWS * (size_t)(n + 1));
    if (!memory) return;
    Contact t = contact_in(memory, n);
    for (long i = 0; i < frames; i++, out += 6) {
        gather(&t, n, x, y, loads + i * n);
        out[5] = torque_limit_in(&t, mu, tangential + 2 * i, about + 2 * i, sense, out);
    }
    free(memory);
}

/* The same with spin (frames), each frame started from the one before.
 * out: (frames, 9): value, lower and upper bound, pole (2), twist (3), kind. */
void utilisations(long frames, long n, const double *x, const double *y, const double *loads, double mu,
                  const double *tangential, const double *spin, const double *about, double *out) {
    double *memory = malloc(sizeof(double) * ROWS * (size_t)(n + 1));
    if (!memory) return;
    Contact t = contact_in(memory, n);
    Twist twist = {NAN, NAN, NAN};
    for (long i = 0; i < frames; i++, out += 9) {
        gather(&t, n, x, y, loads + i * n);
        out[8] = utilisation_in(&t, mu, tangential + 2 * i, spin[i], about + 2 * i, &twist, out);
        out[5] = twist.x, out[6] = twist.y, out[7] = twist.m;
    }
    free(memory);
}
