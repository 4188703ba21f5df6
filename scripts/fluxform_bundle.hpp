/* fluxform_bundle.h for C++11: a bundle that closes itself, with exceptions and containers. This header alone;
 * the C files are compiled as C and linked.
 *
 *   fluxform::Bundle bundle("results/seed/flat/map.npz");      // throws fluxform::Error
 *   std::vector<double> current(bundle.coil_count());          // once: no allocation after this
 *   fluxform::Step step = bundle.currents({x_m, y_m, z_m}, current);   // at every measured position
 *
 *   cc -std=c99 -O2 -c fluxform_bundle.c fluxform_currents.c
 *   c++ -std=c++11 -O2 program.cpp fluxform_bundle.o fluxform_currents.o -o program
 *
 * As in C, a bundle serves one thread at a time.
 */
#ifndef FLUXFORM_BUNDLE_HPP
#define FLUXFORM_BUNDLE_HPP

#include "fluxform_bundle.h"

#include <array>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace fluxform {

/* A place in m, or a force in N, along x, y and z. */
using Vector = std::array<double, 3>;

/* What cannot be loaded, and room of the wrong length. */
class Error : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/* How a position was answered; see FLUXFORM_OK and the others. */
enum class Answer {
    ok = FLUXFORM_OK,
    saturated = FLUXFORM_SATURATED,
    outside = FLUXFORM_OUTSIDE,
    unable = FLUXFORM_UNABLE
};

/* A position answered. */
struct Step : fluxform_step {
    Answer answer;
};

class Bundle {
public:
    /* Loads map.npz. */
    explicit Bundle(const std::string &path)
    {
        char message[256];
        if (fluxform_bundle_open(&bundle_, path.c_str(), message, sizeof message))
            throw Error(message);
    }
    Bundle(Bundle &&other) noexcept { std::swap(bundle_, other.bundle_); }
    Bundle &operator=(Bundle &&other) noexcept
    {
        std::swap(bundle_, other.bundle_);
        return *this;
    }
    Bundle(const Bundle &) = delete;
    Bundle &operator=(const Bundle &) = delete;
    ~Bundle() { fluxform_bundle_close(&bundle_); }

    std::size_t coil_count() const { return bundle_.coil_count; }
    /* Whether forces along x, y and z are held, and currents for uncertainties. */
    bool has_vectors() const { return bundle_.gx_t_per_m_per_a != nullptr; }
    bool has_robust() const { return bundle_.robust_setting != nullptr; }
    /* Everything that the bundle holds. */
    const fluxform_bundle &data() const { return bundle_; }

    /* The currents to command, A, one per coil. */
    Step currents(const Vector &at_m, std::vector<double> &current)
    {
        return step(fluxform_currents, at_m, current);
    }
    /* The same with the least expected error under the bundle's uncertainties. */
    Step robust_currents(const Vector &at_m, std::vector<double> &current)
    {
        return step(fluxform_robust_currents, at_m, current);
    }

    /* Upward force of every coil, N/A; false outside the map, with zeros. */
    bool force_per_ampere(const Vector &at_m, std::vector<double> &force) const
    {
        fits(force, coil_count());
        return fluxform_force_per_ampere(&bundle_, at_m[0], at_m[1], at_m[2], force.data()) != 0;
    }
    /* Force of every coil along x, y and z, N/A, three numbers a coil; false outside the map and without
     * vectors, with zeros. */
    bool force_vectors_per_ampere(const Vector &at_m, std::vector<double> &force) const
    {
        fits(force, 3 * coil_count());
        return fluxform_force_vectors_per_ampere(&bundle_, at_m[0], at_m[1], at_m[2], force.data()) != 0;
    }
    /* The unpowered steel's pull, N, up positive; 0 outside the map and without steel. */
    double passive_force_n(const Vector &at_m) const
    {
        double force = 0.0;
        fluxform_passive_force(&bundle_, at_m[0], at_m[1], at_m[2], &force);
        return force;
    }
    /* Height of the surface, m; 0 where there is none. */
    double height_m(double x_m, double y_m) const
    {
        double height = 0.0;
        fluxform_height(&bundle_, x_m, y_m, &height);
        return height;
    }

private:
    using Currents = int (*)(fluxform_bundle *, double, double, double, double *, fluxform_step *);

    static void fits(const std::vector<double> &room, std::size_t count)
    {
        if (room.size() != count)
            throw Error("room for " + std::to_string(room.size()) + " numbers, expected " + std::to_string(count));
    }

    Step step(Currents compute, const Vector &at_m, std::vector<double> &current)
    {
        fits(current, coil_count());
        Step found{};
        found.answer = static_cast<Answer>(
            compute(&bundle_, at_m[0], at_m[1], at_m[2], current.data(), &found));
        return found;
    }

    fluxform_bundle bundle_{};
};

} // namespace fluxform

#endif
