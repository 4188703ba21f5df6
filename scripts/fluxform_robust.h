/* Currents of the least expected error: a part of fluxform_currents.c, which alone includes it. The algorithm
 * is that of src/lambda/uncertainty/error_form.rs. */
#ifndef FLUXFORM_ROBUST_H
#define FLUXFORM_ROBUST_H

#define SUM_ROUNDS 80
#define SUM_MET 1e-12
#define PULL_ROUNDING 1e-13

/* The rule of degree 5 of Hammer and Stroud over a box: places on the axes and on the diagonals. */
#define RULE_PLACES 14
#define ON_AXES 0.7958224257542215
#define AXES_WEIGHT (40.0 / 361.0)
#define ON_DIAGONALS 0.7587869106393281
#define DIAGONALS_WEIGHT (121.0 / 2888.0)

/* I'HI - 2 b'I + price sum R_i I_i^2 within limits; the arrays lie in the bundle's robust_scratch. */
typedef struct {
    size_t n, free_count;
    const double *lower, *upper;
    double *matrix; /* [n][n]: H, the price on its diagonal */
    double *factor; /* [n][n] */
    double *linear, *right, *others;
    double *free;   /* numbers of the coils that are free, as doubles */
} expected_error;

/* The free currents of the least value, the others as they are, into p->right. */
static void least_of_free(expected_error *p, double price, const double *currents)
{
    size_t n = p->n, count = p->free_count;
    double *l = p->factor;
    memcpy(p->others, currents, n * sizeof *currents);
    for (size_t a = 0; a < count; a++)
        p->others[(size_t)p->free[a]] = 0;
    for (size_t a = 0; a < count; a++) {
        size_t i = (size_t)p->free[a];
        double fixed = 0;
        for (size_t j = 0; j < n; j++)
            fixed += p->matrix[i * n + j] * p->others[j];
        p->right[a] = p->linear[i] - price - fixed;
        for (size_t b = 0; b <= a; b++) {
            double value = p->matrix[i * n + (size_t)p->free[b]];
            for (size_t k = 0; k < b; k++)
                value -= l[a * n + k] * l[b * n + k];
            l[a * n + b] = a == b ? sqrt(value > DBL_MIN ? value : DBL_MIN) : value / l[b * n + b];
        }
    }
    for (size_t a = 0; a < count; a++) {
        for (size_t k = 0; k < a; k++)
            p->right[a] -= l[a * n + k] * p->right[k];
        p->right[a] /= l[a * n + a];
    }
    for (size_t a = count; a-- > 0;) {
        for (size_t k = a + 1; k < count; k++)
            p->right[a] -= l[k * n + a] * p->right[k];
        p->right[a] /= l[a * n + a];
    }
}

/* The least value of I'AI - 2 (b - price)'I over the box. */
static void within_box(expected_error *p, double price, double *currents)
{
    size_t n = p->n;
    p->free_count = 0;
    for (size_t i = 0; i < n; i++)
        if (currents[i] > p->lower[i] && currents[i] < p->upper[i])
            p->free[p->free_count++] = (double)i;
    /* Each turn fixes a coil or frees one; the value falls, so no set comes twice. */
    for (size_t turn = 0; turn < 20 * n + 20; turn++) {
        size_t meets = n, worst = n;
        double share = 1, bound = 0, most = 0;
        least_of_free(p, price, currents);
        for (size_t a = 0; a < p->free_count; a++) {
            size_t i = (size_t)p->free[a];
            double aim = p->right[a], limit = aim > currents[i] ? p->upper[i] : p->lower[i];
            double part = (limit - currents[i]) / (aim - currents[i]);
            if ((aim > p->upper[i] || aim < p->lower[i]) && part < share) {
                share = part;
                meets = a;
                bound = limit;
            }
        }
        for (size_t a = 0; a < p->free_count; a++) {
            size_t i = (size_t)p->free[a];
            currents[i] = clamp(currents[i] + share * (p->right[a] - currents[i]), p->lower[i], p->upper[i]);
        }
        if (meets < n) {
            currents[(size_t)p->free[meets]] = bound;
            p->free_count--;
            memmove(p->free + meets, p->free + meets + 1, (p->free_count - meets) * sizeof *p->free);
            continue;
        }
        for (size_t i = 0; i < n; i++) {
            double slope = price - p->linear[i], size = fabs(p->linear[i]) + price, pull = 0;
            int is_free = 0;
            for (size_t a = 0; a < p->free_count; a++)
                is_free |= (size_t)p->free[a] == i;
            if (is_free)
                continue;
            for (size_t j = 0; j < n; j++) {
                slope += p->matrix[i * n + j] * currents[j];
                size += fabs(p->matrix[i * n + j] * currents[j]);
            }
            if ((slope < 0 && currents[i] < p->upper[i]) || (slope > 0 && currents[i] > p->lower[i]))
                pull = fabs(slope);
            if (pull > PULL_ROUNDING * size && pull > most) {
                most = pull;
                worst = i;
            }
        }
        if (worst == n)
            return;
        p->free[p->free_count++] = (double)worst;
    }
}

static double sum_of_all(const double *currents, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += currents[i];
    return sum;
}

/* The least value within the box and the limit of the sum, from currents within both. */
static void least_expected_error(expected_error *p, double total, double *currents, double *within)
{
    double low = 0, high = DBL_MIN, sum;
    within_box(p, 0, currents);
    if (sum_of_all(currents, p->n) <= total * (1 + SUM_MET))
        return;
    /* Where coils push against each other the multiplier may have to outweigh more than their pulls. */
    for (size_t i = 0; i < p->n; i++) {
        high = fmax(fabs(p->linear[i]), high);
        within[i] = 0;
    }
    within_box(p, high, within);
    while (sum_of_all(within, p->n) > total) {
        low = high;
        high *= 2;
        within_box(p, high, within);
    }
    for (int round = 0; round < SUM_ROUNDS; round++) {
        double middle = 0.5 * (low + high);
        within_box(p, middle, currents);
        sum = sum_of_all(currents, p->n);
        if (sum > total) {
            low = middle;
            continue;
        }
        high = middle;
        memcpy(within, currents, p->n * sizeof *within);
        if (sum >= total * (1 - SUM_MET))
            break;
    }
    memcpy(currents, within, p->n * sizeof *within);
}

/* A place of the rule around a position, moved to the map's ends where it lies beyond; returns its weight. */
static double rule_place(const fluxform_bundle *b, const double *position, size_t k, double *place)
{
    const double *nodes[3];
    size_t counts[3];
    nodes[0] = b->x_m, nodes[1] = b->y_m, nodes[2] = b->z_m;
    counts[0] = b->nx, counts[1] = b->ny, counts[2] = b->nz;
    for (size_t axis = 0; axis < 3; axis++) {
        double unit = k < 6 ? (k / 2 == axis ? (k % 2 ? -ON_AXES : ON_AXES) : 0)
                            : ((k - 6) >> axis & 1 ? -ON_DIAGONALS : ON_DIAGONALS);
        place[axis] = clamp(position[axis] + b->robust_setting[1] * unit, nodes[axis][0], nodes[axis][counts[axis] - 1]);
    }
    return k < 6 ? AXES_WEIGHT : DIAGONALS_WEIGHT;
}

/* One component of the force at a place of this weight: `row` is `stride` numbers apart. */
static void add_component(expected_error *p, const double *setting, const double *row, size_t stride, double wanted,
                          double weight)
{
    double square = weight * setting[2], driver = setting[4];
    for (size_t i = 0; i < p->n; i++) {
        double a = row[stride * i];
        for (size_t j = 0; j <= i; j++)
            p->matrix[i * p->n + j] += square * a * row[stride * j];
        p->matrix[i * p->n + i] += square * driver * a * a;
        p->linear[i] += weight * setting[3] * wanted * a;
    }
}

/* Goes on from the currents of least power to those of the least expected error. */
static void choose_for_uncertainties(fluxform_bundle *b, const double *position, double *currents, fluxform_step *s)
{
    size_t n = b->coil_count, places = b->robust_setting[1] == 0 ? 1 : RULE_PLACES;
    int vector = b->requested_direction != NULL;
    /* The pull goes with the square of the strength, which is even between its least and 1: mean of the cube over
     * the mean. */
    double least = 2 * b->robust_setting[3] - 1, warm = 0.5 * (1 + least * least);
    double *force = b->robust_scratch, *within, wanted[3], place[3];
    expected_error p;
    wanted[0] = s->wanted_x_n, wanted[1] = s->wanted_y_n, wanted[2] = s->wanted_n;
    memset(&p, 0, sizeof p);
    p.n = n;
    p.lower = b->current_min_a;
    p.upper = b->current_max_a;
    p.linear = force + 3 * n;
    p.right = p.linear + n;
    p.others = p.right + n;
    p.free = p.others + n;
    within = p.free + n;
    p.matrix = within + n;
    p.factor = p.matrix + n * n;
    memset(p.linear, 0, n * sizeof *p.linear);
    memset(p.matrix, 0, n * n * sizeof *p.matrix);
    for (size_t k = 0; k < places; k++) {
        double weight = 1, pull = 0;
        memcpy(place, position, sizeof place);
        if (places > 1)
            weight = rule_place(b, position, k, place);
        if (b->passive_force_n)
            fluxform_passive_force(b, place[0], place[1], place[2], &pull);
        pull *= warm;
        if (!vector) {
            fluxform_force_per_ampere(b, place[0], place[1], place[2], force);
            add_component(&p, b->robust_setting, force, 1, wanted[2] - pull, weight);
            continue;
        }
        fluxform_force_vectors_per_ampere(b, place[0], place[1], place[2], force);
        for (size_t axis = 0; axis < 3; axis++)
            add_component(&p, b->robust_setting, force + axis, 3, wanted[axis] - (axis == 2 ? pull : 0), weight);
    }
    for (size_t i = 0; i < n; i++) {
        p.matrix[i * n + i] += b->robust_setting[0] * b->resistance_ohm[i];
        for (size_t j = 0; j < i; j++)
            p.matrix[j * n + i] = p.matrix[i * n + j];
    }
    least_expected_error(&p, b->has_total_current_max ? b->total_current_max_a : INFINITY, currents, within);
    /* The force at the measured position. */
    s->force_x_n = s->force_y_n = 0;
    s->force_n = s->passive_n;
    if (vector)
        fluxform_force_vectors_per_ampere(b, position[0], position[1], position[2], force);
    else
        fluxform_force_per_ampere(b, position[0], position[1], position[2], force);
    for (size_t i = 0; i < n; i++) {
        s->force_n += currents[i] * (vector ? force[3 * i + 2] : force[i]);
        s->force_x_n += vector ? currents[i] * force[3 * i] : 0;
        s->force_y_n += vector ? currents[i] * force[3 * i + 1] : 0;
    }
}

int fluxform_robust_currents(fluxform_bundle *b, double x, double y, double z, double *currents, fluxform_step *step)
{
    double position[3];
    fluxform_step own, *s = step ? step : &own;
    int answer = fluxform_currents(b, x, y, z, currents, s);
    position[0] = x, position[1] = y, position[2] = z;
    if (!b->robust_scratch) {
        memset(currents, 0, b->coil_count * sizeof *currents);
        memset(s, 0, sizeof *s);
        return FLUXFORM_UNABLE;
    }
    if (answer == FLUXFORM_OK || answer == FLUXFORM_SATURATED)
        choose_for_uncertainties(b, position, currents, s);
    return answer;
}

#endif
