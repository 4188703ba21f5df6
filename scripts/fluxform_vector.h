/* Currents of least power for a force vector: a part of fluxform_currents.c, which alone includes it. The
 * algorithm is that of src/lambda/vector_allocation.rs. */
#ifndef FLUXFORM_VECTOR_H
#define FLUXFORM_VECTOR_H

#define EPS_FIRST 1e-7
#define EPS_LEAST 1e-14
#define EPS_FACTOR 1e-3
#define EPS_SUM 1e-6
#define CLIMB_STEPS 60
#define SLOPE_LEFT 0.1
#define MET 1e-11
#define REFINEMENTS 3
#define PULL 1e-9
#define PIVOT 1e-13
#define SPANNED 1e-6

enum { AT_LOWER, AT_FREE, AT_UPPER };

/* Rows of the dual: the force's components, then the sum. */
typedef struct {
    size_t n;
    const double *lower, *upper;
    double target[4], eps[4];
    double *conductance; /* 1 / R over the largest */
    double *rows;        /* weighted force per ampere over the largest, then 1: four a coil */
    double *at;          /* one of the three above */
    double *currents;
    keyed *order;        /* two a coil */
} vector_problem;

/* Sums at a place of the dual. */
typedef struct {
    double slope[4], curvature[4][4];
    int changed;
} dual_place;

static double dot(const double *a, const double *b, int rows)
{
    double sum = 0;
    for (int k = 0; k < rows; k++)
        sum += a[k] * b[k];
    return sum;
}

/* S L of a matrix S L L' S with the diagonal matrix S and the lower triangle L. */
typedef struct {
    double scale[4], l[4][4];
} cholesky;

/* Of a matrix of n rows whose lower triangle is given; 0 where a pivot is at most `least` of its diagonal entry. */
static int factorise(cholesky *f, double lower[4][4], int n, double least)
{
    for (int a = 0; a < n; a++) {
        f->scale[a] = sqrt(lower[a][a]);
        if (!(f->scale[a] > 0 && isfinite(f->scale[a])))
            return 0;
    }
    for (int a = 0; a < n; a++)
        for (int b = 0; b <= a; b++) {
            double value = lower[a][b] / (f->scale[a] * f->scale[b]) - dot(f->l[a], f->l[b], b);
            if (a != b)
                f->l[a][b] = value / f->l[b][b];
            else if (value <= least)
                return 0;
            else
                f->l[a][a] = sqrt(value);
        }
    return 1;
}

/* x = (S L)^-1 right; they may be the same. */
static void forward(const cholesky *f, const double *right, int n, double *x)
{
    for (int a = 0; a < n; a++)
        x[a] = (right[a] / f->scale[a] - dot(f->l[a], x, a)) / f->l[a][a];
}

/* Solves a symmetric positive definite system of n rows; see factorise. */
static int solve_cholesky(double lower[4][4], const double *right, int n, double least, double *x)
{
    cholesky f;
    if (!factorise(&f, lower, n, least))
        return 0;
    for (int a = 0; a < 4; a++)
        x[a] = 0;
    forward(&f, right, n, x);
    for (int a = n - 1; a >= 0; a--) {
        double known = 0;
        for (int k = a + 1; k < n; k++)
            known += f.l[k][a] * x[k];
        x[a] = (x[a] - known) / f.l[a][a];
    }
    for (int a = 0; a < n; a++)
        x[a] /= f.scale[a];
    return 1;
}

/* Currents, slope and curvature of the dual at y. */
static dual_place place_at(vector_problem *p, const double *y, int rows, int all_free)
{
    dual_place place;
    memset(&place, 0, sizeof place);
    place.changed = all_free;
    for (int k = 0; k < rows; k++) {
        place.slope[k] = p->target[k] - p->eps[k] * y[k];
        place.curvature[k][k] = p->eps[k];
    }
    for (size_t i = 0; i < p->n; i++) {
        const double *h = p->rows + 4 * i;
        double alone = p->conductance[i] * dot(h, y, rows), current = alone;
        int at = AT_FREE;
        if (!all_free && !(alone > p->lower[i] && alone < p->upper[i])) {
            at = alone <= p->lower[i] ? AT_LOWER : AT_UPPER;
            current = at == AT_LOWER ? p->lower[i] : p->upper[i];
        }
        place.changed |= at != (int)p->at[i];
        p->at[i] = at;
        p->currents[i] = current;
        for (int k = 0; k < rows; k++)
            place.slope[k] -= h[k] * current;
        for (int k = 0; at == AT_FREE && k < rows; k++)
            for (int l = 0; l <= k; l++)
                place.curvature[k][l] += p->conductance[i] * h[k] * h[l];
    }
    return place;
}

/* Where the dual is highest along a step from y: its slope falls piecewise linearly. */
static double top_along(vector_problem *p, const double *y, const double *step, int rows)
{
    double slope = 0, fall = 0, from = 0;
    size_t count = 0;
    for (int k = 0; k < rows; k++) {
        slope += step[k] * (p->target[k] - p->eps[k] * y[k]);
        fall += p->eps[k] * step[k] * step[k];
    }
    for (size_t i = 0; i < p->n; i++) {
        const double *h = p->rows + 4 * i;
        double c = p->conductance[i], alone = c * dot(h, y, rows), per_step = dot(h, step, rows);
        double speed = c * per_step, leaves, meets;
        slope -= per_step * clamp(alone, p->lower[i], p->upper[i]);
        if (speed == 0)
            continue;
        /* It moves from where it leaves the near limit to where it meets the far one. */
        leaves = ((speed > 0 ? p->lower[i] : p->upper[i]) - alone) / speed;
        meets = ((speed > 0 ? p->upper[i] : p->lower[i]) - alone) / speed;
        if (meets <= 0)
            continue;
        if (leaves <= 0)
            fall += speed * per_step;
        else {
            p->order[count].key = leaves;
            p->order[count++].coil = 2 * i;
        }
        p->order[count].key = meets;
        p->order[count++].coil = 2 * i + 1;
    }
    sort_keys(p->order, count);
    for (size_t k = 0; k < count; k++) {
        size_t i = p->order[k].coil / 2;
        double to = p->order[k].key, per_step = dot(p->rows + 4 * i, step, rows);
        double bend = p->conductance[i] * per_step * per_step;
        if (slope <= fall * (to - from))
            break;
        slope -= fall * (to - from);
        fall += p->order[k].coil % 2 ? -bend : bend;
        from = to;
    }
    return fall > 0 ? from + slope / fall : from;
}

/* Newton's steps to the top of the dual; leaves currents and limits of that place. */
static void climb(vector_problem *p, double *y, int rows)
{
    dual_place place = place_at(p, y, rows, dot(y, y, rows) == 0);
    for (int turn = 0; turn < CLIMB_STEPS; turn++) {
        double step[4], next[4], uphill, length = 1;
        dual_place there;
        if (!solve_cholesky(place.curvature, place.slope, rows, 0, step))
            break;
        uphill = dot(step, place.slope, rows);
        if (!(uphill > 0 && isfinite(uphill)))
            break;
        for (int k = 0; k < 4; k++)
            next[k] = y[k] + step[k];
        there = place_at(p, next, rows, 0);
        if (fabs(dot(step, there.slope, rows)) <= SLOPE_LEFT * uphill) {
            memcpy(y, next, sizeof next);
            place = there;
            if (!place.changed)
                break;
            continue;
        }
        length = top_along(p, y, step, rows);
        for (int k = 0; k < 4; k++)
            y[k] += length * step[k];
        place = place_at(p, y, rows, 0);
    }
}

/* Force that is missing; returns the size of the terms it is a sum of. */
static double missing_force(const vector_problem *p, double *left)
{
    double size = sqrt(dot(p->target, p->target, 3));
    memcpy(left, p->target, 4 * sizeof *left);
    for (size_t i = 0; i < p->n; i++) {
        const double *h = p->rows + 4 * i;
        for (int k = 0; k < 4; k++)
            left[k] -= h[k] * p->currents[i];
        size += sqrt(dot(h, h, 3)) * fabs(p->currents[i]);
    }
    return size;
}

static double size_of(const double *y)
{
    return fabs(y[0]) + fabs(y[1]) + fabs(y[2]) + fabs(y[3]);
}

static double sum_of(const vector_problem *p)
{
    double sum = 0;
    for (size_t i = 0; i < p->n; i++)
        sum += p->currents[i];
    return sum;
}

/* Solves the free currents for the requested force without eps; whether that is optimal. */
static int finish_exactly(vector_problem *p, const double *climbed, int rows)
{
    double system[4][4], damped[4][4], right[4], y[4], left[4], size, terms = 0;
    memset(system, 0, sizeof system);
    memcpy(right, p->target, sizeof right);
    for (size_t i = 0; i < p->n; i++) {
        const double *h = p->rows + 4 * i;
        for (int k = 0; k < rows; k++)
            if ((int)p->at[i] != AT_FREE)
                right[k] -= h[k] * p->currents[i];
            else
                for (int l = 0; l < rows; l++)
                    system[k][l] += p->conductance[i] * h[k] * h[l];
    }
    memcpy(damped, system, sizeof damped);
    for (int k = 0; k < rows; k++)
        damped[k][k] += p->eps[k];
    memcpy(y, climbed, sizeof y);
    for (int turn = 0; turn < REFINEMENTS; turn++) {
        double rest[4], step[4];
        for (int k = 0; k < 4; k++)
            rest[k] = k < rows ? right[k] - dot(system[k], y, rows) : 0;
        if (!solve_cholesky(damped, rest, rows, 0, step))
            return 0;
        for (int k = 0; k < 4; k++)
            y[k] += step[k];
    }
    if (rows == 4 && y[3] > MET * size_of(y))
        return 0;
    for (size_t i = 0; i < p->n; i++) {
        double c = p->conductance[i], alone = c * dot(p->rows + 4 * i, y, rows);
        double range = p->upper[i] - p->lower[i], slack = MET * (c * size_of(y) > range ? c * size_of(y) : range);
        int at = (int)p->at[i];
        if ((at != AT_UPPER && alone < p->lower[i] - slack && at == AT_FREE) ||
            (at == AT_LOWER && alone > p->lower[i] + slack) || (at == AT_FREE && alone > p->upper[i] + slack) ||
            (at == AT_UPPER && alone < p->upper[i] - slack) || isnan(alone))
            return 0;
        if (at == AT_FREE)
            p->currents[i] = clamp(alone, p->lower[i], p->upper[i]);
    }
    size = missing_force(p, left);
    for (size_t i = 0; i < p->n; i++)
        terms += fabs(p->currents[i]);
    return sqrt(dot(left, left, 3)) <= MET * size && sum_of(p) <= p->target[3] + MET * terms;
}

/* Whether no currents within the limits come nearer: what is missing pulls every coil against the limit
 * it is at, the sum's included. */
static int is_nearest(const vector_problem *p, int rows)
{
    double left[4], size = missing_force(p, left), missing = sqrt(dot(left, left, 3));
    double slack = PULL * missing + ROUNDING * size, threshold = 0;
    if (missing <= MET * size)
        return 0;
    if (rows == 4) {
        double price = -INFINITY;
        for (size_t i = 0; i < p->n; i++)
            if ((int)p->at[i] == AT_FREE && dot(p->rows + 4 * i, left, 3) > price)
                price = dot(p->rows + 4 * i, left, 3);
        if (price == -INFINITY || price < -slack)
            return 0;
        threshold = price;
    } else if (sum_of(p) > p->target[3] * (1 + MET))
        return 0;
    for (size_t i = 0; i < p->n; i++) {
        double pull = dot(p->rows + 4 * i, left, 3) - threshold;
        int at = (int)p->at[i];
        if (!(at == AT_LOWER ? pull <= slack : at == AT_UPPER ? pull >= -slack : fabs(pull) <= slack))
            return 0;
    }
    return 1;
}

/* By how much the force of a coil differs from `mean`, per ampere. */
static void differs(const vector_problem *p, size_t i, const double *mean, double *more)
{
    for (int k = 0; k < 4; k++)
        more[k] = p->rows[4 * i + (size_t)k] - mean[k];
}

/* Orthonormal axes of the space that the free coils' differences span, each by its power, the longest first; none for
 * what is no longer than `least`. Returns their number. */
static int spanned(const vector_problem *p, const double *mean, double least, double axes[3][4])
{
    for (int count = 0; count < 3; count++) {
        double longest = least;
        for (size_t i = 0; i < p->n; i++) {
            double rest[4], length;
            if ((int)p->at[i] != AT_FREE)
                continue;
            differs(p, i, mean, rest);
            for (int k = 0; k < 4; k++)
                rest[k] *= sqrt(p->conductance[i]);
            for (int a = 0; a < count; a++) {
                double along = dot(rest, axes[a], 3);
                for (int k = 0; k < 4; k++)
                    rest[k] -= along * axes[a][k];
            }
            length = sqrt(dot(rest, rest, 3));
            if (length > longest) {
                longest = length;
                for (int k = 0; k < 4; k++)
                    axes[count][k] = rest[k] / length;
            }
        }
        if (longest <= least)
            return count;
    }
    return 3;
}

/* Solves the free currents for the nearest force, of several by the least power; whether it is. Where the sum binds
 * they share what the others leave of it, and a coil counts by how much its force differs from their mean. */
static int finish_nearest(vector_problem *p, int rows)
{
    double mean[4] = {0, 0, 0, 0}, axes[3][4], system[4][4], projected[4], solved[4], y[4] = {0, 0, 0, 0};
    double left[4], right[4], sum = 0, conductance = 1, least = 0;
    int count;
    for (size_t i = 0; i < p->n; i++) {
        const double *h = p->rows + 4 * i;
        double size = sqrt(p->conductance[i] * dot(h, h, 3));
        if ((int)p->at[i] != AT_FREE)
            continue;
        p->currents[i] = 0;
        least = size > least ? size : least;
        for (int k = 0; k < 4; k++)
            mean[k] += p->conductance[i] * h[k];
    }
    missing_force(p, left);
    if (rows == 4 && mean[3] > 0) {
        sum = left[3];
        conductance = mean[3];
        for (int k = 0; k < 4; k++)
            mean[k] /= conductance;
    } else
        memset(mean, 0, sizeof mean);
    for (int k = 0; k < 3; k++)
        right[k] = left[k] - mean[k] * sum;
    count = spanned(p, mean, SPANNED * least, axes);
    memset(system, 0, sizeof system);
    for (int a = 0; a < count; a++)
        projected[a] = dot(axes[a], right, 3);
    for (size_t i = 0; i < p->n; i++) {
        double more[4];
        if ((int)p->at[i] != AT_FREE)
            continue;
        differs(p, i, mean, more);
        for (int a = 0; a < count; a++)
            for (int b = 0; b <= a; b++)
                system[a][b] += p->conductance[i] * (dot(axes[a], more, 3) * dot(axes[b], more, 3));
    }
    if (!solve_cholesky(system, projected, count, PIVOT, solved))
        return 0;
    for (int k = 0; k < 3; k++)
        for (int a = 0; a < count; a++)
            y[k] += axes[a][k] * solved[a];
    for (size_t i = 0; i < p->n; i++) {
        double more[4], current, slack = MET * (p->upper[i] - p->lower[i]);
        if ((int)p->at[i] != AT_FREE)
            continue;
        differs(p, i, mean, more);
        current = p->conductance[i] * (sum / conductance + dot(more, y, 3));
        if (!(current >= p->lower[i] - slack && current <= p->upper[i] + slack))
            return 0;
        p->currents[i] = clamp(current, p->lower[i], p->upper[i]);
    }
    return is_nearest(p, rows);
}

static int reached(const vector_problem *p)
{
    double left[4], size = missing_force(p, left);
    return sqrt(dot(left, left, 3)) <= MET * size ? FLUXFORM_OK : FLUXFORM_SATURATED;
}

/* Brings all currents nearer to their lower limits, by the same share, until their sum is within its limit. */
static void lower_to_sum(vector_problem *p)
{
    double sum = sum_of(p), least = 0, share;
    for (size_t i = 0; i < p->n; i++)
        least += p->lower[i];
    if (!(sum > p->target[3]))
        return;
    share = (p->target[3] - least) / (sum - least);
    for (size_t i = 0; i < p->n; i++)
        p->currents[i] = p->lower[i] + share * (p->currents[i] - p->lower[i]);
}

/* Leaves the currents; whether they give the force, and whether that is proven. */
static int solve_vector(vector_problem *p, int *proven)
{
    double size = 0, stiffness = 0, most = 0, within_reach, y[4] = {0, 0, 0, 0};
    for (size_t i = 0; i < p->n; i++) {
        double squared = dot(p->rows + 4 * i, p->rows + 4 * i, 3);
        size += p->conductance[i] * squared;
        stiffness += p->conductance[i];
        most += sqrt(squared) * fmax(p->upper[i], -p->lower[i]);
    }
    /* The multipliers grow with the force beyond reach; the sum's limit holds all the same. */
    *proven = 1;
    within_reach = fmin(most / sqrt(dot(p->target, p->target, 3)), 1);
    for (double share = EPS_FIRST;; share *= EPS_FACTOR) {
        int rows = 3;
        for (int k = 0; k < 3; k++)
            p->eps[k] = share * size;
        p->eps[3] = EPS_SUM * within_reach * share * stiffness;
        y[3] = 0;
        climb(p, y, rows);
        if (sum_of(p) > p->target[3])
            climb(p, y, rows = 4);
        if (finish_exactly(p, y, rows))
            return FLUXFORM_OK;
        if (finish_nearest(p, rows))
            return reached(p);
        if (share * EPS_FACTOR < EPS_LEAST) {
            for (size_t i = 0; i < p->n; i++)
                p->currents[i] = clamp(p->conductance[i] * dot(p->rows + 4 * i, y, rows), p->lower[i], p->upper[i]);
            lower_to_sum(p);
            *proven = 0;
            return reached(p);
        }
    }
}

/* Changes rows and target to coordinates in which the coils without limits give alike in every direction; 0 where
 * they give nothing in one, or nearly. */
static int even_out(vector_problem *p)
{
    double product[4][4];
    cholesky f;
    memset(product, 0, sizeof product);
    for (size_t i = 0; i < p->n; i++)
        for (int k = 0; k < 3; k++)
            for (int l = 0; l <= k; l++)
                product[k][l] += p->conductance[i] * p->rows[4 * i + (size_t)k] * p->rows[4 * i + (size_t)l];
    for (int k = 0; k < 3; k++)
        product[k][k] = product[k][k] == 0 ? 1 : product[k][k];
    if (!factorise(&f, product, 3, PIVOT))
        return 0;
    for (size_t i = 0; i < p->n; i++)
        forward(&f, p->rows + 4 * i, 3, p->rows + 4 * i);
    forward(&f, p->target, 3, p->target);
    return 1;
}

#endif
