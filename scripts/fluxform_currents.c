/* Follows a finger on a loaded bundle: heights and currents; see fluxform_bundle.h. */
#include "fluxform_bundle.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* ---- the surface's height --------------------------------------------------------------------- */

/* The cell that holds a position, and the position's share of its width. */
static int find_between(const double *nodes, size_t n, double position, size_t *at, double *share)
{
    size_t low = 0, high = n;
    *at = 0;
    *share = 0;
    if (n == 1)
        return position == nodes[0];
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (nodes[middle] <= position)
            low = middle + 1;
        else
            high = middle;
    }
    *at = low < 1 ? 0 : low - 1 < n - 2 ? low - 1 : n - 2;
    *share = (position - nodes[*at]) / (nodes[*at + 1] - nodes[*at]);
    for (int node = 0; node < 2; node++)
        if (fabs(*share - node) <= FLUXFORM_AT_NODE) {
            *at += node;
            *share = 0;
            return 1;
        }
    return *share > 0 && *share < 1;
}

/* A value between four nodes, `stride` numbers apart. */
static double bilinear(const double *values, size_t stride, const size_t *node, double s, double t)
{
    double h[4];
    for (size_t k = 0; k < 4; k++)
        h[k] = values[stride * node[k]];
    return (1 - t) * ((1 - s) * h[0] + s * h[1]) + t * ((1 - s) * h[2] + s * h[3]);
}

/* Bilinear between the nodes of the surface: the height, and where there is a `direction` its three
 * components too. Returns 1; where there is no surface 0, with nothing. */
static int on_surface(const fluxform_bundle *b, double x, double y, double *height, double *direction)
{
    size_t column, row, node[4];
    double s, t;
    *height = 0;
    for (size_t k = 0; direction && k < 3; k++)
        direction[k] = 0;
    if (!b->has_rendering || !find_between(b->height_x_m, b->height_nx, x, &column, &s) ||
        !find_between(b->height_y_m, b->height_ny, y, &row, &t))
        return 0;
    /* A node of no weight is not asked: it may lie beyond the grid. */
    node[0] = row * b->height_nx + column;
    node[1] = node[0] + (s > 0);
    node[2] = node[0] + (t > 0 ? b->height_nx : 0);
    node[3] = node[2] + (s > 0);
    for (size_t k = 0; k < 4; k++) {
        double weight = (k & 1 ? s : 1 - s) * (k & 2 ? t : 1 - t);
        if (weight > 0 && b->has_height[node[k]] == 0)
            return 0;
    }
    *height = bilinear(b->height_m, 1, node, s, t);
    for (size_t k = 0; direction && k < 3; k++)
        direction[k] = bilinear(b->requested_direction + k, 3, node, s, t);
    return 1;
}

int fluxform_height(const fluxform_bundle *b, double x, double y, double *height)
{
    return on_surface(b, x, y, height, NULL);
}

int fluxform_direction(const fluxform_bundle *b, double x, double y, double *height, double *direction)
{
    int there = on_surface(b, x, y, height, b->requested_direction ? direction : NULL);
    for (size_t k = 0; !b->requested_direction && k < 3; k++)
        direction[k] = there && k == 2;
    return there;
}

/* ---- currents of least power (the algorithm is described in src/lambda/allocation.rs) -------------- */

/* A coil and where it is sorted to. */
typedef struct {
    double key;
    size_t coil;
} keyed;

/* A bundle has room for 21 numbers a coil: row, ones, tail and force, and two of these; then force vector,
 * conductance, limit and rows of the vector's dual, and two of these again. */
typedef char keyed_fits[sizeof(keyed) <= 2 * sizeof(double) ? 1 : -1];

#define ROUNDING 1e-14
#define TIED 1e-13
#define NOTHING 1e-60
#define FAR 1e3
#define STEPS 120

/* I = clamp((mu (g - center) + nu) / R) */
typedef struct {
    double mu, center, nu;
} multipliers;

typedef struct {
    size_t n;
    const double *lower, *upper, *resistance;
    double total;
    double *row, *ones, *tail;
    keyed *order;
} problem;

static double clamp(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

/* Shell's sort: libc's may allocate. */
static void sort_keys(keyed *keys, size_t n)
{
    static const size_t gaps[] = {701, 301, 132, 57, 23, 10, 4, 1};
    for (size_t g = 0; g < sizeof gaps / sizeof *gaps; g++)
        for (size_t i = gaps[g]; i < n; i++) {
            keyed moved = keys[i];
            size_t j = i;
            for (; j >= gaps[g] && keys[j - gaps[g]].key > moved.key; j -= gaps[g])
                keys[j] = keys[j - gaps[g]];
            keys[j] = moved;
        }
}

static double bound_towards(const problem *p, size_t i, double coefficient)
{
    return coefficient > 0 ? p->upper[i] : p->lower[i];
}

/* The multiplier at which a row's sum meets target > 0; 0 where it cannot. */
static int solve_sorted(problem *p, const double *row, double target, double *mu)
{
    size_t count = 0;
    double free_part = 0, held = 0;
    for (size_t i = 0; i < p->n; i++)
        if (row[i] != 0) {
            p->order[count].key = bound_towards(p, i, row[i]) * p->resistance[i] / row[i];
            p->order[count++].coil = i;
        }
    sort_keys(p->order, count);
    for (size_t k = count; k-- > 0;) {
        size_t i = p->order[k].coil;
        free_part += row[i] * row[i] / p->resistance[i];
        p->tail[k] = free_part;
    }
    for (size_t k = 0; k < count; k++) {
        size_t i = p->order[k].coil;
        if (held + p->order[k].key * p->tail[k] >= target) {
            *mu = (target - held) / p->tail[k];
            return 1;
        }
        held += row[i] * bound_towards(p, i, row[i]);
    }
    *mu = count ? p->order[count - 1].key : 0;
    return count && held >= target;
}

static double current_of(const problem *p, size_t i, multipliers m)
{
    return clamp((m.mu * (p->row[i] - m.center) + m.nu) / p->resistance[i], p->lower[i], p->upper[i]);
}

/* Writes the currents; returns the larger relative residual of force and sum. */
static double fill(const problem *p, multipliers m, double target, double *currents, double *sum)
{
    double force = 0, force_size = 0, sum_size = 0, a, b;
    *sum = 0;
    for (size_t i = 0; i < p->n; i++) {
        double current = currents[i] = current_of(p, i, m);
        force += p->row[i] * current;
        force_size += fabs(p->row[i] * current);
        *sum += current;
        sum_size += fabs(current);
    }
    a = fabs(force - target) / (force_size + target);
    b = sum_size + p->total > 0 ? fabs(*sum - p->total) / (sum_size + p->total) : 0;
    return a > b ? a : b;
}

/* A sum with the rounding of its terms kept. */
static void add(double sum[2], double term)
{
    double head = sum[0] + term, other = head - sum[0];
    if (isfinite(head))
        sum[1] += (sum[0] - (head - other)) + (term - other);
    sum[0] = head;
}

/* Writes the currents of the largest force, of least power among them; returns that force. */
static double largest_force(problem *p, double *currents)
{
    double spent[2] = {0, 0}, force = 0, back = 0;
    size_t start = 0, end;
    for (size_t i = 0; i < p->n; i++) {
        currents[i] = p->lower[i];
        p->order[i].key = -p->row[i];
        p->order[i].coil = i;
    }
    sort_keys(p->order, p->n);
    /* What the coils from a place on give back at their lower limits; terms of one sign, so a limit
     * of 1e30 A beside one of 1 A takes no digit of it. */
    for (size_t k = p->n; k-- > 0;) {
        back -= p->lower[p->order[k].coil];
        p->tail[k] = back;
    }
    for (; start < p->n && -p->order[start].key >= -TIED; start = end) {
        double gain = -p->order[start].key, upper[2] = {0, 0}, left[2] = {p->total, 0}, sum, mu = 0;
        for (end = start; end < p->n && -p->order[end].key >= gain - TIED; end++)
            add(upper, p->upper[p->order[end].coil]);
        add(left, end < p->n ? p->tail[end] : 0);
        add(left, -spent[0]);
        add(left, -spent[1]);
        if (upper[0] + upper[1] <= left[0] + left[1] && gain > TIED) {
            for (size_t k = start; k < end; k++)
                currents[p->order[k].coil] = p->upper[p->order[k].coil];
            add(spent, upper[0]);
            add(spent, upper[1]);
            continue;
        }
        /* What is left is shared among equal coils; coils without force take none of it. */
        memset(p->ones, 0, p->n * sizeof *p->ones);
        for (size_t k = start; k < end; k++)
            p->ones[p->order[k].coil] = 1;
        sum = left[0] + left[1];
        if (gain <= TIED && sum > 0)
            sum = 0;
        if (sum < 0)
            for (size_t i = 0; i < p->n; i++)
                p->ones[i] = -p->ones[i];
        if (sum != 0 && !solve_sorted(p, p->ones, fabs(sum), &mu))
            mu = 1e300;
        for (size_t i = 0; i < p->n; i++)
            if (p->ones[i] != 0)
                currents[i] = clamp(mu * p->ones[i] / p->resistance[i], p->lower[i], p->upper[i]);
        break;
    }
    for (size_t i = 0; i < p->n; i++)
        force += p->row[i] * currents[i];
    return force;
}

static double force_at(const problem *p, double mu, double sigma)
{
    multipliers m = {mu, 0, -sigma};
    double force = 0;
    for (size_t i = 0; i < p->n; i++)
        force += p->row[i] * current_of(p, i, m);
    return force;
}

/* The force's multiplier at which a coil with force meets a limit. */
static double meets(const problem *p, size_t i, double limit, double sigma)
{
    return (limit * p->resistance[i] + sigma) / p->row[i];
}

/* Whether a coil is between its limits all over a piece, which ends where a coil meets its limit: up
 * to the rounding at that end, not at the other, which may lie at 1e30. */
static int moves(const problem *p, size_t i, double sigma, double from, double to)
{
    double low = p->lower[i] * p->resistance[i], high = p->upper[i] * p->resistance[i];
    double a = from * p->row[i] - sigma, b = to * p->row[i] - sigma;
    double least = a < b ? a : b, most = a < b ? b : a;
    return low < high && least >= low - 4 * DBL_EPSILON * (sigma + fabs(least)) &&
           most <= high + 4 * DBL_EPSILON * (sigma + fabs(most));
}

/* The piece between two breakpoints on which the force is met for sigma; returns where. */
static double find_piece(problem *p, double sigma, double target, double *from, double *to)
{
    size_t count = 0, low = 0, high;
    double slope = 0, near, at;
    for (size_t i = 0; i < p->n; i++)
        for (int upper = 0; upper < 2 && p->row[i] != 0; upper++) {
            p->order[count].key = meets(p, i, upper ? p->upper[i] : p->lower[i], sigma);
            p->order[count++].coil = i;
        }
    sort_keys(p->order, count);
    for (high = count; low < high;) {
        size_t middle = low + (high - low) / 2;
        if (force_at(p, p->order[middle].key, sigma) < target)
            low = middle + 1;
        else
            high = middle;
    }
    *to = count ? p->order[low < count ? low : count - 1].key : 0;
    *from = low ? p->order[low - 1].key : *to;
    for (size_t i = 0; i < p->n; i++)
        if (moves(p, i, sigma, *from, *to))
            slope += p->row[i] * p->row[i] / p->resistance[i];
    /* A far end would take the digits: then from the piece's point nearest to nothing. */
    near = clamp(0, *from, *to);
    at = fabs(*to) > FAR * (sigma > fabs(near) ? sigma : fabs(near)) ? near : *to;
    return slope > 0 ? clamp(at + (target - force_at(p, at, sigma)) / slope, *from, *to) : *to;
}

/* The multipliers that meet force and sum if the coils that move on a piece are the ones that do. */
static multipliers solve_piece(const problem *p, double from, double to, double mu, double sigma, double target)
{
    multipliers m = {0.5 * (from + to), 0, -sigma};
    double force = target, sum = p->total, weight = 0, moment = 0, center, rest = 0, spread = 0;
    for (size_t i = 0; i < p->n; i++)
        if (moves(p, i, sigma, from, to)) {
            weight += 1 / p->resistance[i];
            moment += p->row[i] / p->resistance[i];
        } else {
            double current = current_of(p, i, m);
            force -= p->row[i] * current;
            sum -= current;
        }
    m.mu = mu;
    if (weight == 0)
        return m;
    center = moment / weight;
    for (size_t i = 0; i < p->n; i++)
        if (moves(p, i, sigma, from, to))
            rest += (p->row[i] - center) / p->resistance[i] / weight;
    for (size_t i = 0; i < p->n; i++)
        if (moves(p, i, sigma, from, to))
            spread += (p->row[i] - center - rest) * (p->row[i] - center - rest) / p->resistance[i];
    m.mu = spread > TIED * TIED * weight ? (force - (center + rest) * sum) / spread : 0;
    m.center = center;
    m.nu = sum / weight - m.mu * rest;
    return m;
}

/* Force and sum both met, by a search for the sum's multiplier; returns the relative residual. */
static double solve_with_sum(problem *p, double target, double *currents)
{
    double low = 0, high = INFINITY, sigma = 0, stiffness = 0, best = INFINITY, sum;
    multipliers found = {0, 0, 0};
    for (size_t i = 0; i < p->n; i++)
        stiffness += 1 / p->resistance[i];
    for (int step = 0; step < STEPS; step++) {
        double from, to, mu = find_piece(p, sigma, target, &from, &to);
        multipliers here = {mu, 0, -sigma}, jump = solve_piece(p, from, to, mu, sigma, target);
        double fault = fill(p, jump, target, currents, &sum), next = jump.mu * jump.center - jump.nu;
        if (fault < best && next >= 0) {
            best = fault;
            found = jump;
        }
        if (best <= ROUNDING)
            break;
        fill(p, here, target, currents, &sum);
        if (sum > p->total)
            low = sigma;
        else
            high = sigma;
        if (low < next && next < high && step % 3 != 2)
            sigma = next;
        else if (high == INFINITY)
            sigma = 4 * low > (sum - p->total) / stiffness ? 4 * low : (sum - p->total) / stiffness;
        else
            sigma = low > 0 && high > 4 * low ? sqrt(low * high) : 0.5 * (low + high);
        if (!(low < sigma && sigma < high))
            break;
    }
    fill(p, found, target, currents, &sum);
    return best;
}

int fluxform_allocate(fluxform_bundle *b, const double *force_per_ampere, double wanted, double *currents)
{
    size_t n = b->coil_count;
    problem p = {n, b->current_min_a, b->current_max_a, b->resistance_ohm, INFINITY, b->scratch, NULL, NULL, NULL};
    double scale = 0, target, most, sum;
    multipliers m = {0, 0, 0};
    for (size_t i = 0; i < n; i++) {
        currents[i] = 0;
        scale = fabs(force_per_ampere[i]) > scale ? fabs(force_per_ampere[i]) : scale;
    }
    if (wanted == 0 || isnan(wanted) || !b->scratch || !isfinite(1 / scale))
        return wanted == 0 ? FLUXFORM_OK : FLUXFORM_SATURATED;
    if (wanted < 0)
        scale = -scale;
    if (b->has_total_current_max)
        p.total = b->total_current_max_a;
    p.ones = p.row + n;
    p.tail = p.ones + n;
    p.order = (keyed *)(void *)(b->scratch + 4 * n);
    for (size_t i = 0; i < n; i++)
        p.row[i] = fabs(force_per_ampere[i] / scale) < NOTHING ? 0 : force_per_ampere[i] / scale;
    target = wanted / scale;
    if (solve_sorted(&p, p.row, target, &m.mu)) {
        fill(&p, m, target, currents, &sum);
        if (sum <= p.total)
            return FLUXFORM_OK;
    }
    most = largest_force(&p, currents);
    if (target >= most * (1 - ROUNDING))
        return target > most * (1 + ROUNDING) ? FLUXFORM_SATURATED : FLUXFORM_OK;
    if (solve_with_sum(&p, target, currents) > 1 - target / most)
        largest_force(&p, currents);
    return FLUXFORM_OK;
}

#include "fluxform_vector.h"

int fluxform_allocate_vector(fluxform_bundle *b, const double *force_per_ampere, const double *wanted, double *currents)
{
    size_t n = b->coil_count;
    double largest = 0, least = INFINITY, weights[3];
    int nothing = wanted[0] == 0 && wanted[1] == 0 && wanted[2] == 0, proven, answer;
    vector_problem p;
    weights[0] = weights[1] = b->sideways_weight;
    weights[2] = 1;
    for (size_t i = 0; i < n; i++) {
        currents[i] = 0;
        least = b->resistance_ohm[i] < least ? b->resistance_ohm[i] : least;
        for (size_t k = 0; k < 3; k++)
            if (fabs(force_per_ampere[3 * i + k]) > largest)
                largest = fabs(force_per_ampere[3 * i + k]);
    }
    if (nothing || !b->scratch || !isfinite(wanted[0]) || !isfinite(wanted[1]) || !isfinite(wanted[2]) ||
        !isfinite(1 / largest))
        return nothing ? FLUXFORM_OK : FLUXFORM_SATURATED;
    memset(&p, 0, sizeof p);
    p.n = n;
    p.lower = b->current_min_a;
    p.upper = b->current_max_a;
    p.currents = currents;
    p.conductance = b->scratch + 11 * n;
    p.at = p.conductance + n;
    p.rows = p.at + n;
    p.order = (keyed *)(void *)(p.rows + 4 * n);
    for (size_t i = 0; i < n; i++) {
        p.conductance[i] = least / b->resistance_ohm[i];
        p.at[i] = AT_FREE;
        for (size_t k = 0; k < 3; k++)
            p.rows[4 * i + k] = force_per_ampere[3 * i + k] * weights[k] * (1 / largest);
        p.rows[4 * i + 3] = 1;
    }
    for (size_t k = 0; k < 3; k++)
        p.target[k] = wanted[k] * weights[k] * (1 / largest);
    p.target[3] = b->has_total_current_max ? b->total_current_max_a : INFINITY;
    answer = solve_vector(&p, &proven);
    if (proven || !even_out(&p))
        return answer;
    p.currents = b->scratch + 21 * n;
    if (solve_vector(&p, &proven) == FLUXFORM_OK && proven) {
        memcpy(currents, p.currents, n * sizeof *currents);
        answer = FLUXFORM_OK;
    }
    return answer;
}

/* As fluxform_currents, for all three components of the force. */
static int vector_currents(fluxform_bundle *b, double x, double y, double z, double *currents, fluxform_step *s)
{
    double *force = b->scratch + 8 * b->coil_count, direction[3], wanted[3], given[3] = {0, 0, 0};
    int answer;
    if (!fluxform_force_vectors_per_ampere(b, x, y, z, force))
        return FLUXFORM_OUTSIDE;
    if (b->passive_force_n)
        fluxform_passive_force(b, x, y, z, &s->passive_n);
    fluxform_direction(b, x, y, &s->height_m, direction);
    for (size_t k = 0; k < 3; k++)
        wanted[k] = b->lambda_n_per_m * s->height_m * direction[k];
    s->wanted_x_n = wanted[0];
    s->wanted_y_n = wanted[1];
    s->wanted_n = wanted[2];
    wanted[2] -= s->passive_n;
    answer = fluxform_allocate_vector(b, force, wanted, currents);
    for (size_t i = 0; i < b->coil_count; i++)
        for (size_t k = 0; k < 3; k++)
            given[k] += force[3 * i + k] * currents[i];
    s->force_x_n = given[0];
    s->force_y_n = given[1];
    s->force_n = given[2] + s->passive_n;
    return answer;
}

int fluxform_currents(fluxform_bundle *b, double x, double y, double z, double *currents, fluxform_step *step)
{
    fluxform_step s = {0, 0, 0, 0, 0, 0, 0, 0};
    int answer = FLUXFORM_UNABLE;
    for (size_t i = 0; i < b->coil_count; i++)
        currents[i] = 0;
    if (b->has_rendering && b->has_lambda && b->requested_direction)
        answer = vector_currents(b, x, y, z, currents, &s);
    else if (b->has_rendering && b->has_lambda) {
        double *force = b->scratch + 3 * b->coil_count;
        answer = FLUXFORM_OUTSIDE;
        if (fluxform_force_per_ampere(b, x, y, z, force)) {
            if (b->passive_force_n)
                fluxform_passive_force(b, x, y, z, &s.passive_n);
            fluxform_height(b, x, y, &s.height_m);
            s.wanted_n = b->lambda_n_per_m * s.height_m;
            answer = fluxform_allocate(b, force, s.wanted_n - s.passive_n, currents);
            s.force_n = s.passive_n;
            for (size_t i = 0; i < b->coil_count; i++)
                s.force_n += force[i] * currents[i];
        }
    }
    if (step)
        *step = s;
    return answer;
}

#include "fluxform_robust.h"
