/* Loads a fluxform bundle and interpolates its map; see fluxform_bundle.h. */
#if defined(__unix__) || defined(__APPLE__)
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif
#define HAS_POSIX 1
#endif

#include "fluxform_bundle.h"

#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef HAS_POSIX
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#endif

/* Larger numbers are none that a coil or magnet gives; nodes lie within FARTHEST and no closer to
 * each other than CLOSEST [m]: then what interpolation and equation 8 make of them is finite. */
#define LARGEST 1e30
#define FARTHEST 1e6
#define CLOSEST 1e-15

#define SCHEMA_MAJOR 1
#define MAX_DIMENSIONS 6
#define MAX_ENTRIES 64

/* Larger files are none of ours; of one beyond HOLES_FROM at least one byte in HOLES_SHARE lies on
 * the disk: a file of holes takes far more memory than it took to make. */
#define FILE_MAX 0x100000000u
#define HOLES_FROM (16 << 20)
#define HOLES_SHARE 64
#ifdef __linux__
#define WHENCE_HOLE 4
#endif

/* ---- the file in memory -------------------------------------------------------------------- */

typedef struct {
    const unsigned char *data;
    size_t size;
    char *message;
    size_t message_size;
    size_t directory, entries; /* known once check_archive has passed */
} archive;

static int fail(const archive *a, const char *name, const char *what)
{
    if (a->message && a->message_size > 0)
        snprintf(a->message, a->message_size, "%s%s%s", name, *name ? ": " : "", what);
    return -1;
}

static uint32_t u16(const unsigned char *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8;
}

static uint32_t u32(const unsigned char *p)
{
    return u16(p) | u16(p + 2) << 16;
}

static uint64_t u64(const unsigned char *p)
{
    return (uint64_t)u32(p) | (uint64_t)u32(p + 4) << 32;
}

static double f64(const unsigned char *p)
{
    uint64_t bits = u64(p);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

#ifdef HAS_POSIX
static int has_holes(int descriptor, const struct stat *facts)
{
#ifdef WHENCE_HOLE
    /* Some file systems count blocks late; they know of no hole then. */
    return facts->st_size > HOLES_FROM && facts->st_size / HOLES_SHARE / 512 > facts->st_blocks &&
           (lseek(descriptor, 0, WHENCE_HOLE) < facts->st_size || lseek(descriptor, 0, SEEK_SET) != 0);
#else
    (void)descriptor;
    (void)facts;
    return 0;
#endif
}
#endif

/* Opens a plain file: a pipe would keep its reader waiting, a link may lead out of the bundle. */
static FILE *open_plain(const char *path)
{
#ifdef HAS_POSIX
    struct stat facts;
    FILE *file;
    int descriptor = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
    if (descriptor < 0)
        return NULL;
    if (fstat(descriptor, &facts) != 0 || !S_ISREG(facts.st_mode) || has_holes(descriptor, &facts) ||
        !(file = fdopen(descriptor, "rb"))) {
        close(descriptor);
        return NULL;
    }
    return file;
#else
    return fopen(path, "rb");
#endif
}

static unsigned char *read_file(const char *path, size_t *size, const archive *a)
{
    FILE *file = open_plain(path);
    unsigned char *data = NULL;
    long length = -1;
    if (!file) {
        fail(a, path, "cannot be opened, or is a link, full of holes or no plain file");
        return NULL;
    }
    if (fseek(file, 0, SEEK_END) == 0)
        length = ftell(file);
    if (length > 0 && (uint64_t)length > FILE_MAX)
        fail(a, path, "is larger than 4 GiB");
    else if (length <= 0 || length == LONG_MAX || fseek(file, 0, SEEK_SET) != 0)
        fail(a, path, "cannot be read");
    else if (!(data = malloc((size_t)length)))
        fail(a, path, "does not fit into memory");
    else if (fread(data, 1, (size_t)length, file) != (size_t)length) {
        fail(a, path, "cannot be read");
        free(data);
        data = NULL;
    }
    fclose(file);
    *size = (size_t)length;
    return data;
}

static uint32_t crc32_of(const unsigned char *data, size_t size)
{
    uint32_t table[256], crc = 0xffffffffu;
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t c = i;
        for (int k = 0; k < 8; k++)
            c = c & 1 ? 0xedb88320u ^ c >> 1 : c >> 1;
        table[i] = c;
    }
    for (size_t i = 0; i < size; i++)
        crc = table[(crc ^ data[i]) & 0xff] ^ crc >> 8;
    return ~crc;
}

/* ---- stored zip and NPY 1.0 ---------------------------------------------------------------- */

typedef struct {
    const unsigned char *data; /* elements of 8 bytes, little-endian */
    size_t dimensions;
    size_t shape[MAX_DIMENSIONS];
    size_t count;
} array;

/* The directory's part at `at`, before `end`; how long it is, or 0 where it is damaged. */
static size_t head_at(const archive *a, size_t at, size_t end)
{
    size_t step;
    if (end - at < 46 || u32(a->data + at) != 0x02014b50u)
        return 0;
    step = (size_t)46 + u16(a->data + at + 28) + u16(a->data + at + 30) + u16(a->data + at + 32);
    return end - at < step ? 0 : step;
}

/* An entry's bytes, stored as they are between the file's start and the directory, under the name that the
 * directory has for them: a damaged name would hide an array. */
static int entry_at(const archive *a, size_t at, const unsigned char **data, size_t *size)
{
    const unsigned char *head = a->data + at;
    size_t stored = u32(head + 20), local = u32(head + 42), begin;
    if (u16(head + 10) != 0 || (u16(head + 8) & 1) || stored != u32(head + 24))
        return fail(a, "", "an entry is compressed, encrypted or larger than 4 GiB");
    if (local > a->directory || a->directory - local < 30 || u32(a->data + local) != 0x04034b50u)
        return fail(a, "", "an entry lies outside the file");
    begin = (size_t)30 + u16(a->data + local + 26) + u16(a->data + local + 28);
    if (a->directory - local < begin || a->directory - local - begin < stored)
        return fail(a, "", "an entry lies outside the file");
    if (u16(a->data + local + 26) != u16(head + 28) || memcmp(a->data + local + 30, head + 46, u16(head + 28)) != 0)
        return fail(a, "", "an entry has another name in the directory");
    *data = a->data + local + begin;
    *size = stored;
    return 0;
}

static int same_name(const archive *a, size_t at, size_t other)
{
    size_t size = u16(a->data + at + 28);
    return size == u16(a->data + other + 28) && memcmp(a->data + at + 46, a->data + other + 46, size) == 0;
}

/* All loaders accept the same archives: the directory fills the file from the last entry to an end
 * record without a comment, and every entry is stored as it is, undamaged, its name the same in both
 * places and there once (of two, other programs may read the other one). */
static int check_archive(archive *a)
{
    size_t end, at, other, step;
    if (a->size < 22 || u32(a->data + a->size - 22) != 0x06054b50u || u16(a->data + a->size - 2) != 0)
        return fail(a, "", "not a zip archive, cut short, or with bytes behind its end");
    end = a->size - 22;
    a->entries = u16(a->data + end + 10);
    a->directory = u32(a->data + end + 16);
    if (u32(a->data + end + 4) != 0 || u16(a->data + end + 8) != a->entries || a->directory > end ||
        end - a->directory != u32(a->data + end + 12))
        return fail(a, "", "the archive's directory is damaged");
    if (a->entries > MAX_ENTRIES)
        return fail(a, "", "the archive has more than 64 entries");
    at = a->directory;
    for (size_t i = 0; i < a->entries; i++, at += step) {
        const unsigned char *data;
        size_t size;
        if (!(step = head_at(a, at, end)))
            return fail(a, "", "the archive's directory is damaged");
        if (entry_at(a, at, &data, &size))
            return -1;
        if (crc32_of(data, size) != u32(a->data + at + 16))
            return fail(a, "", "an entry is damaged (CRC)");
        for (other = a->directory; other < at; other += head_at(a, other, end))
            if (same_name(a, at, other))
                return fail(a, "", "an entry stands there twice");
    }
    return at == end ? 0 : fail(a, "", "the archive's directory is damaged");
}

/* The bytes of an entry of a checked archive: 1 found, 0 absent. */
static int find_entry(const archive *a, const char *name, const unsigned char **data, size_t *size)
{
    size_t at = a->directory;
    char wanted[64];
    snprintf(wanted, sizeof wanted, "%s.npy", name);
    for (size_t i = 0; i < a->entries; i++, at += head_at(a, at, a->size - 22))
        if (u16(a->data + at + 28) == strlen(wanted) && memcmp(a->data + at + 46, wanted, strlen(wanted)) == 0)
            return entry_at(a, at, data, size) ? -1 : 1;
    return 0;
}

/* Compares header text with what numpy writes, blanks aside; moves on. */
static int skip(const char **text, const char *end, const char *expected)
{
    const char *p = *text;
    for (; *expected; expected++) {
        while (p < end && *p == ' ')
            p++;
        if (p >= end || *p != *expected)
            return 0;
        p++;
    }
    while (p < end && *p == ' ')
        p++;
    *text = p;
    return 1;
}

static int parse_shape(const char **text, const char *end, array *out)
{
    out->dimensions = 0;
    out->count = 1;
    while (*text < end && **text >= '0' && **text <= '9') {
        size_t size = 0;
        if (out->dimensions == MAX_DIMENSIONS)
            return 0;
        for (; *text < end && **text >= '0' && **text <= '9'; (*text)++) {
            size_t digit = (size_t)(**text - '0');
            if (size > (SIZE_MAX - digit) / 10)
                return 0;
            size = 10 * size + digit;
        }
        if (size != 0 && out->count > SIZE_MAX / 8 / size)
            return 0;
        out->count *= size;
        out->shape[out->dimensions++] = size;
        if (!skip(text, end, ","))
            break;
    }
    return 1;
}

/* An array of the archive: 1 found, 0 absent, -1 damaged. `kind` is "<f8" or "<i8". */
static int find_array(const archive *a, const char *name, const char *kind, size_t dimensions, array *out)
{
    const unsigned char *data = NULL;
    const char *text, *end;
    char start[64];
    size_t size = 0, length;
    int found = find_entry(a, name, &data, &size);
    if (found <= 0)
        return found;
    if (size < 10 || memcmp(data, "\x93NUMPY\x01\x00", 8) != 0)
        return fail(a, name, "is not an NPY 1.0 array");
    length = u16(data + 8);
    if (size - 10 < length)
        return fail(a, name, "ends within its header");
    text = (const char *)data + 10;
    end = text + length;
    snprintf(start, sizeof start, "{'descr':'%s','fortran_order':False,'shape':(", kind);
    if (!skip(&text, end, start) || !parse_shape(&text, end, out) || !skip(&text, end, ")"))
        return fail(a, name, "is not of the expected kind, C order, little-endian");
    (void)skip(&text, end, ",");
    if (!skip(&text, end, "}") || end - text > 1 || (text < end && *text != '\n'))
        return fail(a, name, "has a damaged header");
    if (out->dimensions != dimensions || out->count != (size - 10 - length) / 8 || (size - 10 - length) % 8)
        return fail(a, name, "does not hold what its shape says");
    out->data = data + 10 + length;
    return 1;
}

/* ---- loading ------------------------------------------------------------------------------- */

/* Like find_array, but the array must be there. */
static int need(const archive *a, const char *name, const char *kind, size_t dimensions, array *out)
{
    int found = find_array(a, name, kind, dimensions, out);
    return found == 0 ? fail(a, name, "is missing") : found < 0 ? -1 : 0;
}

/* Copies an array of finite numbers; NULL on failure. */
static double *copy(const archive *a, const char *name, const array *from)
{
    double *to = malloc(from->count ? from->count * sizeof *to : 1);
    if (!to) {
        fail(a, name, "does not fit into memory");
        return NULL;
    }
    for (size_t i = 0; i < from->count; i++) {
        to[i] = f64(from->data + 8 * i);
        if (!isfinite(to[i])) {
            fail(a, name, "holds a number that is not finite");
            free(to);
            return NULL;
        }
        if (fabs(to[i]) > LARGEST) {
            fail(a, name, "holds a number beyond 1e30");
            free(to);
            return NULL;
        }
    }
    return to;
}

static int load_line(const archive *a, const char *name, double **values, size_t *count)
{
    array from;
    if (need(a, name, "<f8", 1, &from) || !(*values = copy(a, name, &from)))
        return -1;
    *count = from.count;
    return 0;
}

static int load_axis(const archive *a, const char *name, double **nodes, size_t *count)
{
    if (load_line(a, name, nodes, count))
        return -1;
    if (*count == 0)
        return fail(a, name, "has no nodes");
    for (size_t i = 1; i < *count; i++)
        if (!((*nodes)[i - 1] < (*nodes)[i]))
            return fail(a, name, "must increase from node to node");
    for (size_t i = 0; i < *count; i++)
        if (fabs((*nodes)[i]) > FARTHEST || (i > 0 && (*nodes)[i] - (*nodes)[i - 1] < CLOSEST))
            return fail(a, name, "must have nodes within 1e6 m and 1e-15 m apart");
    return 0;
}

static int load_scalar(const archive *a, const char *name, double *value)
{
    array from;
    int found = find_array(a, name, "<f8", 0, &from);
    if (found == 1) {
        *value = f64(from.data);
        if (!(fabs(*value) <= LARGEST))
            return fail(a, name, "is not finite, or beyond 1e30");
    }
    return found;
}

static int load_coils(fluxform_bundle *b, const archive *a)
{
    array from;
    size_t count;
    if (load_line(a, "current_max_a", &b->current_max_a, &b->coil_count))
        return -1;
    if (load_line(a, "current_min_a", &b->current_min_a, &count) || count != b->coil_count)
        return fail(a, "current_min_a", "must hold one number a coil");
    if (load_line(a, "resistance_ohm", &b->resistance_ohm, &count) || count != b->coil_count)
        return fail(a, "resistance_ohm", "must hold one number a coil");
    if (need(a, "coil", "<i8", 1, &from))
        return -1;
    b->map_count = from.count;
    if (!(b->coil = malloc(from.count ? from.count * sizeof *b->coil : 1)))
        return fail(a, "coil", "does not fit into memory");
    for (size_t i = 0; i < from.count; i++) {
        uint64_t index = u64(from.data + 8 * i);
        if (index >= b->coil_count || (i > 0 && index <= b->coil[i - 1]))
            return fail(a, "coil", "must hold increasing indices of coils");
        b->coil[i] = (size_t)index;
    }
    return 0;
}

static int load_map(fluxform_bundle *b, const archive *a, const char *name, size_t dimensions, double **values)
{
    array from;
    const size_t shape[MAX_DIMENSIONS] = {b->map_count, b->nz, b->ny, b->nx, 3, 3};
    if (need(a, name, "<f8", dimensions, &from))
        return -1;
    for (size_t i = 0; i < dimensions; i++)
        if (from.shape[i] != shape[i])
            return fail(a, name, "does not have the shape of its axes");
    return (*values = copy(a, name, &from)) ? 0 : -1;
}

static int load_passive(fluxform_bundle *b, const archive *a)
{
    const char *name = "passive_force_n";
    array from;
    int found = find_array(a, name, "<f8", 3, &from);
    if (found <= 0)
        return found;
    if (from.shape[0] != b->nz || from.shape[1] != b->ny || from.shape[2] != b->nx)
        return fail(a, name, "does not have the shape of its axes");
    return (b->passive_force_n = copy(a, name, &from)) ? 0 : -1;
}

/* An array of the given shape; `rows` is 0 for arrays of one dimension. */
static int load_grid(const archive *a, const char *name, size_t rows, size_t columns, double **values)
{
    array from;
    if (need(a, name, "<f8", rows ? 2 : 1, &from))
        return -1;
    if (from.shape[rows ? 1 : 0] != columns || (rows && from.shape[0] != rows))
        return fail(a, name, "does not have the expected shape");
    return (*values = copy(a, name, &from)) ? 0 : -1;
}

/* The force vector that a bundle requests, where it does. */
static int load_requested(fluxform_bundle *b, const archive *a)
{
    const char *name = "requested_direction";
    array from;
    int found = find_array(a, name, "<f8", 3, &from);
    if (found <= 0)
        return found;
    if (from.shape[0] != b->height_ny || from.shape[1] != b->height_nx || from.shape[2] != 3)
        return fail(a, name, "does not have the expected shape");
    if (!b->gx_t_per_m_per_a)
        return fail(a, "gx_t_per_m_per_a", "is missing");
    if (!(b->requested_direction = copy(a, name, &from)))
        return -1;
    found = load_scalar(a, "sideways_weight", &b->sideways_weight);
    if (found <= 0 || !(b->sideways_weight >= 1e-6 && b->sideways_weight <= 1))
        return found < 0 ? -1 : fail(a, "sideways_weight", "must lie between 1e-6 and 1");
    return 0;
}

/* What currents chosen for uncertainties need, where the bundle was made with some. */
static int load_robust(fluxform_bundle *b, const archive *a)
{
    const char *name = "robust_setting";
    array from;
    size_t n = b->coil_count;
    int found = find_array(a, name, "<f8", 1, &from);
    if (found <= 0)
        return found;
    if (from.shape[0] != 5)
        return fail(a, name, "does not have the expected shape");
    if (!(b->robust_setting = copy(a, name, &from)))
        return -1;
    for (size_t i = 0; i < 5; i++)
        if (!(b->robust_setting[i] >= 0) || b->robust_setting[0] == 0)
            return fail(a, name, "must hold a price above 0 and nothing below 0");
    if (!(b->robust_scratch = calloc(2 * n + 9, (n + 1) * sizeof(double)))) /* see fluxform_robust.h */
        return fail(a, "", "no memory");
    return 0;
}

static int load_rendering(fluxform_bundle *b, const archive *a)
{
    array from;
    int found = find_array(a, "height_x_m", "<f8", 1, &from);
    if (found <= 0)
        return found;
    if (load_axis(a, "height_x_m", &b->height_x_m, &b->height_nx) ||
        load_axis(a, "height_y_m", &b->height_y_m, &b->height_ny) ||
        load_grid(a, "height_m", b->height_ny, b->height_nx, &b->height_m) ||
        load_grid(a, "has_height", b->height_ny, b->height_nx, &b->has_height) ||
        load_grid(a, "static_current_a", 0, b->coil_count, &b->static_current_a))
        return -1;
    for (size_t i = 0; i < b->coil_count; i++)
        if (!(b->resistance_ohm[i] >= 1 / LARGEST && b->current_min_a[i] <= 0 && b->current_max_a[i] >= 0))
            return fail(a, "current_max_a", "limits must enclose 0, and resistances be above 0");
    for (size_t i = 0; i < b->height_nx * b->height_ny; i++)
        if (b->has_height[i] != 0 && b->has_height[i] != 1)
            return fail(a, "has_height", "must hold 0 or 1");
    if (load_requested(b, a) || load_robust(b, a))
        return -1;
    if (!(b->scratch = calloc(b->coil_count + 1, 22 * sizeof(double)))) /* see fluxform_currents.c */
        return fail(a, "", "no memory");
    b->has_rendering = 1;
    return 0;
}

/* An array that is not loaded: absent, or of the given shape and finite. */
static int check_array(const archive *a, const char *name, size_t dimensions, const size_t *shape)
{
    array from;
    int found = find_array(a, name, "<f8", dimensions, &from);
    if (found <= 0)
        return found;
    for (size_t i = 0; i < dimensions; i++)
        if (from.shape[i] != shape[i])
            return fail(a, name, "does not have the expected shape");
    for (size_t i = 0; i < from.count; i++)
        if (!(fabs(f64(from.data + 8 * i)) <= LARGEST))
            return fail(a, name, "holds a number that is not finite, or beyond 1e30");
    return 0;
}

/* What forces and currents do not need is refused where it does not fit, as by the other loaders. */
static int check_others(const fluxform_bundle *b, const archive *a)
{
    const size_t grid[MAX_DIMENSIONS] = {b->map_count, b->nz, b->ny, b->nx, 3, 3};
    const size_t coils[] = {b->coil_count, b->coil_count};
    return check_array(a, "gradient_t_per_m_per_a", 6, grid) || check_array(a, "field_t_per_a", 5, grid) ||
                   check_array(a, "working_point_gz_t_per_m", 3, grid + 1) ||
                   check_array(a, "inductance_h", 2, coils) || check_array(a, "voltage_v", 0, NULL)
               ? -1
               : 0;
}

static int load_all(fluxform_bundle *b, archive *a)
{
    array from;
    int tilted, found;
    if (check_archive(a))
        return -1;
    if (need(a, "schema_version", "<i8", 1, &from))
        return -1;
    if (from.count != 3 || u64(from.data) != SCHEMA_MAJOR)
        return fail(a, "schema_version", "is not one that this loader reads");
    if (load_axis(a, "x_m", &b->x_m, &b->nx) || load_axis(a, "y_m", &b->y_m, &b->ny) ||
        load_axis(a, "z_m", &b->z_m, &b->nz) || load_coils(b, a))
        return -1;
    if (need(a, "moment_a_m2", "<f8", 1, &from))
        return -1;
    if (from.count != 3)
        return fail(a, "moment_a_m2", "must hold three numbers");
    for (size_t i = 0; i < 3; i++) {
        b->moment_a_m2[i] = f64(from.data + 8 * i);
        if (!(fabs(b->moment_a_m2[i]) <= LARGEST))
            return fail(a, "moment_a_m2", "holds a number that is not finite, or beyond 1e30");
    }
    if (load_map(b, a, "gz_t_per_m_per_a", 4, &b->gz_t_per_m_per_a))
        return -1;
    tilted = b->moment_a_m2[0] != 0 || b->moment_a_m2[1] != 0;
    if (tilted && load_map(b, a, "gradient_t_per_m_per_a", 6, &b->gradient_t_per_m_per_a))
        return -1;
    found = find_array(a, "gx_t_per_m_per_a", "<f8", 4, &from);
    if (found < 0 || (found == 0 && find_array(a, "gy_t_per_m_per_a", "<f8", 4, &from) != 0))
        return found < 0 ? -1 : fail(a, "gx_t_per_m_per_a", "is missing");
    if (found && (load_map(b, a, "gx_t_per_m_per_a", 4, &b->gx_t_per_m_per_a) ||
                  load_map(b, a, "gy_t_per_m_per_a", 4, &b->gy_t_per_m_per_a)))
        return -1;
    if (load_passive(b, a))
        return -1;
    if (load_rendering(b, a) || check_others(b, a))
        return -1;
    b->has_total_current_max = load_scalar(a, "total_current_max_a", &b->total_current_max_a);
    if (b->has_total_current_max > 0 && b->total_current_max_a < 0)
        return fail(a, "total_current_max_a", "must be 0 or more");
    b->has_lambda = load_scalar(a, "lambda_n_per_m", &b->lambda_n_per_m);
    return b->has_total_current_max < 0 || b->has_lambda < 0 ? -1 : 0;
}

int fluxform_bundle_open(fluxform_bundle *bundle, const char *path, char *message, size_t message_size)
{
    archive a = {NULL, 0, message, message_size, 0, 0};
    unsigned char *data;
    int outcome;
    memset(bundle, 0, sizeof *bundle);
    if (!(data = read_file(path, &a.size, &a)))
        return -1;
    a.data = data;
    outcome = load_all(bundle, &a);
    free(data);
    if (outcome)
        fluxform_bundle_close(bundle);
    return outcome;
}

void fluxform_bundle_close(fluxform_bundle *bundle)
{
    free(bundle->x_m);
    free(bundle->y_m);
    free(bundle->z_m);
    free(bundle->coil);
    free(bundle->gz_t_per_m_per_a);
    free(bundle->gx_t_per_m_per_a);
    free(bundle->gy_t_per_m_per_a);
    free(bundle->requested_direction);
    free(bundle->robust_setting);
    free(bundle->robust_scratch);
    free(bundle->gradient_t_per_m_per_a);
    free(bundle->passive_force_n);
    free(bundle->current_min_a);
    free(bundle->current_max_a);
    free(bundle->resistance_ohm);
    free(bundle->height_x_m);
    free(bundle->height_y_m);
    free(bundle->height_m);
    free(bundle->has_height);
    free(bundle->static_current_a);
    free(bundle->scratch);
    memset(bundle, 0, sizeof *bundle);
}

/* ---- tricubic Lagrange interpolation -------------------------------------------------------- */

typedef struct {
    size_t start, count;
    double weights[4];
} stencil;

/* The (at most) four nearest nodes and their weights; 0 outside the nodes' range. */
static int find_stencil(const double *nodes, size_t n, double position, stencil *s)
{
    size_t low = 0, high = n;
    const double first = n < 2 ? 0 : FLUXFORM_AT_NODE * (nodes[1] - nodes[0]);
    const double last = n < 2 ? 0 : FLUXFORM_AT_NODE * (nodes[n - 1] - nodes[n - 2]);
    if (!(nodes[0] - first <= position && position <= nodes[n - 1] + last))
        return 0;
    while (low < high) { /* the number of nodes <= position */
        size_t middle = low + (high - low) / 2;
        if (nodes[middle] <= position)
            low = middle + 1;
        else
            high = middle;
    }
    s->count = n < 4 ? n : 4;
    s->start = low < 2 ? 0 : low - 2;
    if (s->start > n - s->count)
        s->start = n - s->count;
    for (size_t k = 0; k < s->count; k++) {
        const double *near = nodes + s->start;
        double above = 1, below = 1;
        for (size_t j = 0; j < s->count; j++)
            if (j != k) {
                above *= position - near[j];
                below *= near[k] - near[j];
            }
        s->weights[k] = above / below;
    }
    return 1;
}

typedef struct {
    stencil x, y, z;
} cell;

static int find_cell(const fluxform_bundle *b, double x, double y, double z, cell *c)
{
    return find_stencil(b->x_m, b->nx, x, &c->x) && find_stencil(b->y_m, b->ny, y, &c->y) &&
           find_stencil(b->z_m, b->nz, z, &c->z);
}

static double interpolate(const fluxform_bundle *b, const cell *c, const double *values, size_t components)
{
    double sum = 0;
    if (components == 1 && c->x.count == 4) { /* four sums side by side: none waits for another */
        double lanes[4] = {0, 0, 0, 0};
        for (size_t k = 0; k < c->z.count; k++)
            for (size_t j = 0; j < c->y.count; j++) {
                const double *row = values + ((c->z.start + k) * b->ny + c->y.start + j) * b->nx + c->x.start;
                const double weight = c->z.weights[k] * c->y.weights[j];
                for (size_t i = 0; i < 4; i++)
                    lanes[i] += weight * row[i];
            }
        for (size_t i = 0; i < 4; i++)
            sum += c->x.weights[i] * lanes[i];
        return sum;
    }
    for (size_t k = 0; k < c->z.count; k++) {
        double plane = 0;
        for (size_t j = 0; j < c->y.count; j++) {
            size_t node = ((c->z.start + k) * b->ny + c->y.start + j) * b->nx + c->x.start;
            double row = 0;
            for (size_t i = 0; i < c->x.count; i++)
                row += c->x.weights[i] * values[(node + i) * components];
            plane += c->y.weights[j] * row;
        }
        sum += c->z.weights[k] * plane;
    }
    return sum;
}

int fluxform_gz_per_ampere(const fluxform_bundle *b, double x, double y, double z, double *gz)
{
    const size_t nodes = b->nx * b->ny * b->nz;
    cell c;
    for (size_t i = 0; i < b->coil_count; i++)
        gz[i] = 0;
    if (!find_cell(b, x, y, z, &c))
        return 0;
    for (size_t i = 0; i < b->map_count; i++)
        gz[b->coil[i]] = interpolate(b, &c, b->gz_t_per_m_per_a + i * nodes, 1);
    return 1;
}

int fluxform_force_per_ampere(const fluxform_bundle *b, double x, double y, double z, double *force)
{
    const size_t nodes = b->nx * b->ny * b->nz;
    const double *m = b->moment_a_m2;
    cell c;
    if (!b->gradient_t_per_m_per_a) {
        int inside = fluxform_gz_per_ampere(b, x, y, z, force);
        for (size_t i = 0; i < b->coil_count; i++)
            force[i] *= m[2];
        return inside;
    }
    for (size_t i = 0; i < b->coil_count; i++)
        force[i] = 0;
    if (!find_cell(b, x, y, z, &c))
        return 0;
    for (size_t i = 0; i < b->map_count; i++) {
        /* dB_x/dz, dB_y/dz, dB_z/dz are components 2, 5 and 8. */
        const double *block = b->gradient_t_per_m_per_a + 9 * i * nodes;
        force[b->coil[i]] = m[0] * interpolate(b, &c, block + 2, 9) +
                            m[1] * interpolate(b, &c, block + 5, 9) +
                            m[2] * interpolate(b, &c, block + 8, 9);
    }
    return 1;
}

int fluxform_force_vectors_per_ampere(const fluxform_bundle *b, double x, double y, double z, double *force)
{
    const size_t nodes = b->nx * b->ny * b->nz;
    const double *m = b->moment_a_m2;
    cell c;
    for (size_t i = 0; i < 3 * b->coil_count; i++)
        force[i] = 0;
    if (!b->gx_t_per_m_per_a || !find_cell(b, x, y, z, &c))
        return 0;
    for (size_t i = 0; i < b->map_count; i++) {
        const double *maps[] = {b->gx_t_per_m_per_a, b->gy_t_per_m_per_a, b->gz_t_per_m_per_a};
        double *own = force + 3 * b->coil[i];
        for (size_t k = 0; k < 3; k++)
            own[k] = m[2] * interpolate(b, &c, maps[k] + i * nodes, 1);
        if (b->gradient_t_per_m_per_a) {
            /* F = grad (m . B): of a tilted magnet all of the gradient counts. */
            const double *block = b->gradient_t_per_m_per_a + 9 * i * nodes;
            for (size_t k = 0; k < 3; k++)
                own[k] = m[0] * interpolate(b, &c, block + k, 9) + m[1] * interpolate(b, &c, block + 3 + k, 9) +
                         m[2] * interpolate(b, &c, block + 6 + k, 9);
        }
    }
    return 1;
}

int fluxform_passive_force(const fluxform_bundle *b, double x, double y, double z, double *force)
{
    cell c;
    *force = 0;
    if (!find_cell(b, x, y, z, &c))
        return 0;
    if (b->passive_force_n)
        *force = interpolate(b, &c, b->passive_force_n, 1);
    return 1;
}
