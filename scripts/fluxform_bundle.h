/* Load the map of a fluxform bundle. C99, libc only; no allocation after loading.
 *
 *   fluxform_bundle bundle;
 *   char message[256];
 *   if (fluxform_bundle_open(&bundle, "results/seed/flat/map.npz", message, sizeof message)) {
 *       fprintf(stderr, "%s\n", message);
 *       return 3;
 *   }
 *   double force[64];                                  // at least bundle.coil_count
 *   fluxform_force_per_ampere(&bundle, x_m, y_m, z_m, force);
 *   fluxform_bundle_close(&bundle);
 *
 * The file is treated as untrusted: every offset and size is checked, and so is the CRC of every
 * array used. All it needs is in map.npz; manifest.json need not be read.
 */
#ifndef FLUXFORM_BUNDLE_H
#define FLUXFORM_BUNDLE_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fluxform_bundle {
    size_t nx, ny, nz;            /* nodes along each axis */
    double *x_m, *y_m, *z_m;      /* the nodes, increasing */
    size_t map_count;             /* coils whose maps were kept ... */
    size_t *coil;                 /* ... and their indices in the array */
    double *gz_t_per_m_per_a;     /* [map][z][y][x] */
    double *passive_force_n;      /* [z][y][x]; NULL where the unpowered steel's pull is left out */
    double *gradient_t_per_m_per_a; /* [map][z][y][x][3][3]; NULL unless the magnet is tilted */
    double moment_a_m2[3];        /* the magnet */
    size_t coil_count;            /* coils of the array */
    double *current_min_a;        /* one a coil of the array */
    double *current_max_a;
    double *resistance_ohm;
    int has_total_current_max;    /* whether there is such a limit */
    double total_current_max_a;
    int has_lambda;               /* whether a force constant was found */
    double lambda_n_per_m;
} fluxform_bundle;

/* Loads map.npz. Returns 0, or -1 with a message; then nothing needs closing. */
int fluxform_bundle_open(fluxform_bundle *bundle, const char *path, char *message, size_t message_size);

/* Frees what was loaded. */
void fluxform_bundle_close(fluxform_bundle *bundle);

/* dB_z/dz [T/m/A] of every coil of the array at a position in m: coil_count numbers, zero for coils
 * left out of the map. Returns 1; outside the map 0, with all zeros. */
int fluxform_gz_per_ampere(const fluxform_bundle *bundle, double x_m, double y_m, double z_m, double *gz);

/* Upward force on the magnet's centre [N/A], in the same manner. */
int fluxform_force_per_ampere(const fluxform_bundle *bundle, double x_m, double y_m, double z_m, double *force);

/* What the unpowered steel adds to that force whatever the currents [N], up positive: zero for
 * bundles without it. Returns 1; outside the map 0, with zero. */
int fluxform_passive_force(const fluxform_bundle *bundle, double x_m, double y_m, double z_m, double *force);

#ifdef __cplusplus
}
#endif

#endif
