/* fluxform_replay.c in C++: reads lines "x y z" (m) and prints for each what the C program prints.
 *
 *   cc -std=c99 -O2 -c fluxform_bundle.c fluxform_currents.c
 *   c++ -std=c++11 -O2 fluxform_replay.cpp fluxform_bundle.o fluxform_currents.o -o replay
 *   ./replay map.npz < points
 */
#include "fluxform_bundle.hpp"

#include <cstdlib>
#include <cstring>
#include <iostream>
#include <limits>

static void print(const std::vector<double> &numbers)
{
    for (double number : numbers)
        std::cout << ' ' << number;
}

/* The next position on standard input, blank lines aside; false at the end. */
static bool read_position(fluxform::Vector &at, std::size_t &number)
{
    const char *const blanks = " \t\r\n";
    std::string line;
    while (std::getline(std::cin, line)) {
        const char *rest = line.c_str() + std::strspn(line.c_str(), blanks);
        const char *const last = line.c_str() + line.size();
        std::size_t count = 0;
        ++number;
        if (rest == last)
            continue;
        for (; count < 3; count++) {
            char *end;
            at[count] = std::strtod(rest, &end);
            if (end == rest || !std::strchr(blanks, *end))
                break;
            rest = end + std::strspn(end, blanks);
        }
        if (count == 3 && rest == last)
            return true;
        throw fluxform::Error("line " + std::to_string(number) + ": invalid position: expected x y z, three numbers");
    }
    return false;
}

static void tell(fluxform::Bundle bundle)
{
    std::vector<double> current(bundle.coil_count()), force(current), vectors(3 * current.size());
    fluxform::Vector at;
    std::size_t number = 0;
    std::cout.precision(std::numeric_limits<double>::max_digits10);
    while (read_position(at, number)) {
        bundle.force_per_ampere(at, force);
        const fluxform::Step step = bundle.currents(at, current);
        print(force);
        print({bundle.passive_force_n(at), step.height_m, static_cast<double>(step.answer), step.force_n});
        print(current);
        if (bundle.data().requested_direction) {
            bundle.force_vectors_per_ampere(at, vectors);
            print({step.wanted_x_n, step.wanted_y_n, step.wanted_n, step.force_x_n, step.force_y_n});
            print(vectors);
        }
        if (bundle.has_robust()) {
            const fluxform::Step robust = bundle.robust_currents(at, current);
            print({robust.force_x_n, robust.force_y_n, robust.force_n});
            print(current);
        }
        std::cout << '\n';
    }
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        std::cerr << "usage: " << argv[0] << " map.npz < points\n";
        return 2;
    }
    try {
        tell(fluxform::Bundle(argv[1]));
    } catch (const fluxform::Error &error) {
        std::cerr << error.what() << '\n';
        return 3;
    }
    return 0;
}
