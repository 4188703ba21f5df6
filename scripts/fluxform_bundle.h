/* Load a fluxform bundle and follow a finger with it. C99, libc only; no allocation after loading.
 * Compile fluxform_bundle.c and fluxform_currents.c with your program; fluxform_replay.c is one.
 *
 *   fluxform_bundle bundle;
 *   char message[256];
 *   if (fluxform_bundle_open(&bundle, "results/seed/flat/map.npz", message, sizeof message)) {
 *       fprintf(stderr, "%s\n", message);
 *       return 3;
 *   }
 *   double current[64];                                // at least bundle.coil_count
 *   fluxform_step step;
 *   fluxform_currents(&bundle, x_m, y_m, z_m, current, &step);   // at every measured position
 *   fluxform_bundle_close(&bundle);
 *
 * The file is treated as untrusted: it must be a plain file and no link; every offset and size is
 * checked, and so is the CRC of every array used. All it needs is in map.npz; manifest.json need not be read. A bundle holds room to
 * work in: fluxform_currents and fluxform_allocate serve one thread at a time.
 */
#ifndef FLUXFORM_BUNDLE_H
#define FLUXFORM_BUNDLE_H

#include <stddef.h>

/* Share of a cell's width from a node within which a position is at the node: computed otherwise the
 * same coordinate has other last bits. */
#define FLUXFORM_AT_NODE 1e-9

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fluxform_bundle {
    size_t nx, ny, nz;            /* nodes along each axis */
    double *x_m, *y_m, *z_m;      /* the nodes, increasing */
    size_t map_count;             /* coils whose maps were kept ... */
    size_t *coil;                 /* ... and their indices in the array */
    double *gz_t_per_m_per_a;     /* [map][z][y][x] */
    double *gx_t_per_m_per_a;     /* dB_x/dz, as gz; NULL where the upward force alone is held, as the next */
    double *gy_t_per_m_per_a;
    double *passive_force_n;      /* [z][y][x]; NULL where the unpowered steel's pull is left out */
    double *gradient_t_per_m_per_a; /* [map][z][y][x][3][3]; NULL unless the magnet is tilted */
    double moment_a_m2[3];        /* the magnet */
    size_t coil_count;            /* coils of the array */
    double *current_min_a;        /* one per coil of the array */
    double *current_max_a;
    double *resistance_ohm;
    int has_total_current_max;    /* whether there is such a limit */
    double total_current_max_a;
    int has_lambda;               /* whether a force constant was found */
    double lambda_n_per_m;
    /* What following a finger needs; absent (has_rendering 0) from bundles before schema 1.2. */
    int has_rendering;
    size_t height_nx, height_ny;  /* nodes of the surface's grid */
    double *height_x_m, *height_y_m;
    double *height_m;             /* [y][x] */
    double *has_height;           /* [y][x]: 1 where there is a surface, else 0 */
    double *static_current_a;     /* the bundle's fixed currents, one per coil of the array */
    double *requested_direction;  /* [y][x][3]: force vector over lambda times the height; NULL: upward alone */
    double sideways_weight;       /* out of reach a sideways error counts as this share of an upward one */
    /* Price of power, sensor's bound, square and mean of the magnet's strength, square of a driver's error; NULL
     * for bundles made without uncertainties, as the room that their currents take. */
    double *robust_setting, *robust_scratch;
    double *scratch;              /* for the functions below that change the bundle */
} fluxform_bundle;

/* How a position was answered. */
enum {
    FLUXFORM_OK = 0,        /* the currents give the requested force */
    FLUXFORM_SATURATED = 1, /* their limits allow only the nearest force */
    FLUXFORM_OUTSIDE = 2,   /* outside the map: no currents */
    FLUXFORM_UNABLE = -1    /* no force constant, or a bundle before schema 1.2 */
};

/* What fluxform_currents found. */
typedef struct fluxform_step {
    double height_m;  /* of the surface; 0 where there is none */
    double wanted_n;  /* upward: lambda times that height, or that part of a force along the normal */
    double force_n;   /* upward, given by the currents, the unpowered steel's pull included */
    double passive_n; /* that pull */
    /* Sideways; 0 for bundles that request the upward force alone. */
    double wanted_x_n, wanted_y_n;
    double force_x_n, force_y_n;
} fluxform_step;

/* Loads map.npz. Returns 0, or -1 with a message; then nothing needs closing. */
int fluxform_bundle_open(fluxform_bundle *bundle, const char *path, char *message, size_t message_size);

/* Frees what was loaded. */
void fluxform_bundle_close(fluxform_bundle *bundle);

/* dB_z/dz [T/m/A] of every coil of the array at a position in m: coil_count numbers, zero for coils
 * left out of the map. Returns 1; outside the map 0, with all zeros. */
int fluxform_gz_per_ampere(const fluxform_bundle *bundle, double x_m, double y_m, double z_m, double *gz);

/* Upward force on the magnet's centre [N/A], in the same manner. */
int fluxform_force_per_ampere(const fluxform_bundle *bundle, double x_m, double y_m, double z_m, double *force);

/* Force on the magnet's centre along x, y and z [N/A]: three numbers a coil, in the same manner. For bundles
 * that hold the upward force alone 0, with all zeros. */
int fluxform_force_vectors_per_ampere(const fluxform_bundle *bundle, double x_m, double y_m, double z_m,
                                      double *force);

/* What the unpowered steel adds to that force whatever the currents [N], up positive: zero for
 * bundles without it. Returns 1; outside the map 0, with zero. */
int fluxform_passive_force(const fluxform_bundle *bundle, double x_m, double y_m, double z_m, double *force);

/* Height of the surface [m], bilinear between the bundle's points. Returns 1; where there is no
 * surface 0, with 0. */
int fluxform_height(const fluxform_bundle *bundle, double x_m, double y_m, double *height);

/* The same with the direction of the force that is requested there, over lambda times the height: three
 * numbers, upward for bundles that request no other. */
int fluxform_direction(const fluxform_bundle *bundle, double x_m, double y_m, double *height, double *direction);

/* The currents [A] of least power that give wanted_n for the forces per ampere given, within the
 * limits of every current and of their sum (equation 8), or the nearest force; none for a force that
 * is not a number. Returns FLUXFORM_OK or FLUXFORM_SATURATED. */
int fluxform_allocate(fluxform_bundle *bundle, const double *force_per_ampere, double wanted_n, double *currents);

/* The same for a force vector: three numbers a coil, three wanted. The nearest force is the one whose
 * difference is shortest, its sideways parts times the bundle's sideways_weight. */
int fluxform_allocate_vector(fluxform_bundle *bundle, const double *force_per_ampere, const double *wanted_n,
                             double *currents);

/* The currents [A] to command at a position in m, coil_count numbers; `step` may be NULL. Returns
 * one of the answers above; but for the first two all currents are zero. */
int fluxform_currents(fluxform_bundle *bundle, double x_m, double y_m, double z_m, double *currents,
                      fluxform_step *step);

/* The same with the currents of the least expected error under the uncertainties that the bundle was made with.
 * The answer is that of the exact position. FLUXFORM_UNABLE also for bundles made without uncertainties. */
int fluxform_robust_currents(fluxform_bundle *bundle, double x_m, double y_m, double z_m, double *currents,
                             fluxform_step *step);

#ifdef __cplusplus
}
#endif

#endif
