/* A program on top of fluxform_bundle.h.
 *
 * `program map.npz` reads lines "x y z" (m) and prints for each the force per ampere [N/A] of every
 * coil, the unpowered steel's pull [N], the surface's height [m] (0 outside the map), the answer (0 ok, 1 saturated,
 * 2 outside, -1 unable), the force given [N] and the current [A] of every coil; for bundles that request a force
 * vector also the vector wanted, the sideways force given [N] and the vectors of force per ampere of every coil; for
 * those made with uncertainties the force given along x, y and z [N] and the currents [A] chosen for them.
 * `program map.npz REPEATS` reads the same lines and prints the nanoseconds that a step takes, with a third
 * argument that of currents chosen for uncertainties. A line that is no position ends it with code 3; `nan` is a number:
 *   cc -std=c99 -O2 fluxform_replay.c fluxform_bundle.c fluxform_currents.c -o replay -lm
 */
#include "fluxform_bundle.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define BLANKS " \t\r\n"

/* The next position on standard input, blank lines aside: 1 read, 0 at the end, -1 for a line that is no position. */
static int read_position(double *at, size_t *number)
{
    char line[256];
    while (fgets(line, sizeof line, stdin)) {
        const int whole = strchr(line, '\n') || feof(stdin);
        const char *rest = line + strspn(line, BLANKS);
        size_t count = 0;
        ++*number;
        if (whole && !*rest)
            continue;
        for (; count < 3; count++) {
            char *end;
            at[count] = strtod(rest, &end);
            if (end == rest || !strchr(BLANKS, *end))
                break;
            rest = end + strspn(end, BLANKS);
        }
        if (whole && count == 3 && !*rest)
            return 1;
        fprintf(stderr, "line %lu: invalid position: expected x y z, three numbers\n", (unsigned long)*number);
        return -1;
    }
    return 0;
}

static int tell(fluxform_bundle *bundle, double *force, double *current)
{
    double at[3], pull, *vectors = current + bundle->coil_count;
    size_t number = 0;
    fluxform_step step;
    int outcome;
    while ((outcome = read_position(at, &number)) > 0) {
        const double x = at[0], y = at[1], z = at[2];
        int answer;
        fluxform_force_per_ampere(bundle, x, y, z, force);
        for (size_t i = 0; i < bundle->coil_count; i++)
            printf("%.17g ", force[i]);
        fluxform_passive_force(bundle, x, y, z, &pull);
        answer = fluxform_currents(bundle, x, y, z, current, &step);
        printf("%.17g %.17g %d %.17g", pull, step.height_m, answer, step.force_n);
        for (size_t i = 0; i < bundle->coil_count; i++)
            printf(" %.17g", current[i]);
        if (bundle->requested_direction) {
            fluxform_force_vectors_per_ampere(bundle, x, y, z, vectors);
            printf(" %.17g %.17g %.17g %.17g %.17g", step.wanted_x_n, step.wanted_y_n, step.wanted_n,
                   step.force_x_n, step.force_y_n);
            for (size_t i = 0; i < 3 * bundle->coil_count; i++)
                printf(" %.17g", vectors[i]);
        }
        if (bundle->robust_setting) {
            fluxform_robust_currents(bundle, x, y, z, current, &step);
            printf(" %.17g %.17g %.17g", step.force_x_n, step.force_y_n, step.force_n);
            for (size_t i = 0; i < bundle->coil_count; i++)
                printf(" %.17g", current[i]);
        }
        printf("\n");
    }
    return outcome ? 3 : 0;
}

static int measure(fluxform_bundle *bundle, double *current, long repeats, int robust)
{
    size_t count = 0, room = 0, number = 0;
    double *at = NULL, p[3], sum = 0, best = 1e300;
    int outcome;
    while ((outcome = read_position(p, &number)) > 0) {
        if (count == room) {
            double *more = realloc(at, (room = 2 * room + 1024) * 3 * sizeof *at);
            if (!more) {
                free(at);
                return 3;
            }
            at = more;
        }
        for (size_t k = 0; k < 3; k++)
            at[3 * count + k] = p[k];
        count++;
    }
    if (outcome) {
        free(at);
        return 3;
    }
    for (long run = 0; run < repeats && count; run++) {
        clock_t start = clock();
        double each;
        for (size_t i = 0; i < count; i++) {
            (robust ? fluxform_robust_currents : fluxform_currents)(bundle, at[3 * i], at[3 * i + 1],
                                                                    at[3 * i + 2], current, NULL);
            sum += current[0];
        }
        each = (double)(clock() - start) / CLOCKS_PER_SEC / (double)count * 1e9;
        best = each < best ? each : best;
    }
    free(at);
    printf("%.1f %.17g\n", best, sum);
    return 0;
}

int main(int argc, char **argv)
{
    fluxform_bundle bundle;
    char message[256];
    double *force;
    int outcome;
    if (argc < 2 || argc > 4) {
        fprintf(stderr, "usage: %s map.npz [REPEATS [robust]] < points\n", argv[0]);
        return 2;
    }
    if (fluxform_bundle_open(&bundle, argv[1], message, sizeof message)) {
        fprintf(stderr, "%s\n", message);
        return 3;
    }
    if (!(force = calloc(5 * bundle.coil_count + 1, sizeof *force))) {
        fluxform_bundle_close(&bundle);
        return 3;
    }
    outcome = argc == 2 ? tell(&bundle, force, force + bundle.coil_count)
                        : measure(&bundle, force, strtol(argv[2], NULL, 10), argc == 4);
    free(force);
    fluxform_bundle_close(&bundle);
    return outcome;
}
