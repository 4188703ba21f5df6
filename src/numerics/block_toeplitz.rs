//! Products with a matrix of blocks that depend on the difference of two cells of a plane lattice alone,
//! by Fourier transforms.

use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixView};
use rayon::prelude::*;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

/// Pairs of columns that are transformed together; fixed, so that memory is bounded and bytes do not
/// depend on threads.
const PAIRS: usize = 32;
/// Frequencies that are multiplied one after the other: as many numbers as a few lines of the cache have.
const BESIDE: usize = 8;

/// The sum over all cells `j` of a block for the step from `j` to `i`, applied at `j`, for every cell `i`.
pub struct BlockToeplitz {
    rows: usize,
    columns: usize,
    plane: Plane,
    /// Places of the cells in the plane.
    places: Vec<usize>,
    /// Of half of the frequencies: real part over imaginary part.
    spectrum: Vec<DMatrix<f64>>,
}

impl BlockToeplitz {
    /// For `cells` of a lattice and blocks of `rows` x `columns`, `put` being given every step and its
    /// block, zero, to fill.
    pub fn new(
        cells: &[[usize; 2]],
        (rows, columns): (usize, usize),
        put: impl Fn([isize; 2], &mut DMatrix<f64>) + Sync,
    ) -> Self {
        let most = |axis: usize| cells.iter().map(|c| c[axis]).max().unwrap_or(0);
        let steps = [0, 1].map(most).map(|most| most as isize);
        let size = steps.map(|most| smooth(2 * most as usize + 1));
        let plane = Plane::new(size, most(1) + 1);
        let all: Vec<[isize; 2]> = (-steps[1]..=steps[1])
            .flat_map(|y| (-steps[0]..=steps[0]).map(move |x| [x, y]))
            .collect();
        let blocks: Vec<(usize, DMatrix<f64>)> = all
            .par_iter()
            .map(|step| {
                fluxform_base::progress::poll();
                let mut block = DMatrix::zeros(rows, columns);
                put(*step, &mut block);
                (plane.place(*step), block)
            })
            .collect();
        // Two real entries are one complex one: a column of a block together with the next.
        let half = plane.half();
        let entries: Vec<(usize, usize)> = (0..columns.div_ceil(2))
            .flat_map(|pair| (0..rows).map(move |row| (row, 2 * pair)))
            .collect();
        let mut spectrum = vec![DMatrix::zeros(2 * rows, columns); half];
        for entries in entries.chunks(PAIRS * 8) {
            let transformed: Vec<Vec<Complex<f64>>> = entries
                .par_iter()
                .map(|&(row, column)| {
                    fluxform_base::progress::poll();
                    let mut values = vec![Complex::default(); plane.size()];
                    for (place, block) in &blocks {
                        let next = block.get((row, column + 1)).copied().unwrap_or(0.0);
                        values[*place] = Complex::new(block[(row, column)], next);
                    }
                    plane.forward(values, plane.size[1])
                })
                .collect();
            spectrum.par_iter_mut().enumerate().for_each(|(k, block)| {
                fluxform_base::progress::poll();
                for (&(row, column), values) in entries.iter().zip(&transformed) {
                    let (one, other) = (values[k], values[plane.opposite(k)].conj());
                    let (first, second) = ((one + other) * 0.5, (one - other) * 0.5);
                    block[(row, column)] = first.re;
                    block[(row + rows, column)] = first.im;
                    if column + 1 < columns {
                        block[(row, column + 1)] = second.im;
                        block[(row + rows, column + 1)] = -second.re;
                    }
                }
            });
        }
        Self {
            rows,
            columns,
            places: cells
                .iter()
                .map(|cell| plane.place(cell.map(|c| c as isize)))
                .collect(),
            plane,
            spectrum,
        }
    }

    /// The product with columns that hold every cell's values one after the other.
    #[must_use]
    pub fn apply(&self, values: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.rows * self.places.len(), values.ncols());
        for first in (0..values.ncols()).step_by(2 * PAIRS) {
            let count = (2 * PAIRS).min(values.ncols() - first);
            self.apply_some(values.columns(first, count), first, &mut out);
        }
        out
    }

    fn apply_some(&self, values: DMatrixView<'_, f64>, first: usize, out: &mut DMatrix<f64>) {
        // A real product acts on the parts of a complex column alike: two columns are one.
        let pairs = values.ncols().div_ceil(2);
        let spectra: Vec<Vec<Complex<f64>>> = (0..self.columns * pairs)
            .into_par_iter()
            .map(|index| {
                fluxform_base::progress::poll();
                let (channel, pair) = (index % self.columns, index / self.columns);
                let mut plane = vec![Complex::default(); self.plane.size()];
                for (cell, place) in self.places.iter().enumerate() {
                    let at = |column| values.get((cell * self.columns + channel, column));
                    let next = at(2 * pair + 1).copied().unwrap_or(0.0);
                    plane[*place] =
                        Complex::new(values[(cell * self.columns + channel, 2 * pair)], next);
                }
                self.plane.forward(plane, self.plane.rows)
            })
            .collect();
        // Several frequencies at a time: a plane is read by whole lines of the processor's cache.
        let starts: Vec<usize> = (0..self.spectrum.len()).step_by(BESIDE).collect();
        let products: Vec<Vec<[Complex<f64>; 2]>> = starts
            .par_iter()
            .map(|start| self.products(*start, pairs, &spectra))
            .collect();
        drop(spectra);
        let scale = 1.0 / self.plane.size() as f64;
        let planes: Vec<Vec<Complex<f64>>> = (0..self.rows * pairs)
            .into_par_iter()
            .map(|index| {
                fluxform_base::progress::poll();
                let mut plane = vec![Complex::default(); self.plane.size()];
                for (start, products) in starts.iter().zip(&products) {
                    let of_plane = products.chunks_exact(products.len() / (self.rows * pairs));
                    for (k, [one, other]) in of_plane.skip(index).take(1).flatten().enumerate() {
                        plane[self.plane.opposite(start + k)] = *other;
                        plane[start + k] = *one;
                    }
                }
                self.plane.back(plane)
            })
            .collect();
        for (index, plane) in planes.iter().enumerate() {
            fluxform_base::progress::poll();
            let (row, pair) = (index % self.rows, index / self.rows);
            for (cell, place) in self.places.iter().enumerate() {
                let value = plane[*place] * scale;
                out[(cell * self.rows + row, first + 2 * pair)] = value.re;
                if 2 * pair + 1 < values.ncols() {
                    out[(cell * self.rows + row, first + 2 * pair + 1)] = value.im;
                }
            }
        }
    }

    /// Products at some frequencies from `start` on and at their opposites, [row of a pair, frequency], of
    /// what every channel of every pair of columns has there.
    fn products(
        &self,
        start: usize,
        pairs: usize,
        spectra: &[Vec<Complex<f64>>],
    ) -> Vec<[Complex<f64>; 2]> {
        let blocks = &self.spectrum[start..self.spectrum.len().min(start + BESIDE)];
        // Real parts of every frequency, imaginary ones, then those of its opposite.
        let mut given = vec![DMatrix::zeros(self.columns, 4 * pairs); blocks.len()];
        for (index, plane) in spectra.iter().enumerate() {
            fluxform_base::progress::poll();
            let (channel, pair) = (index % self.columns, index / self.columns);
            for (k, given) in given.iter_mut().enumerate() {
                let (one, other) = (plane[start + k], plane[self.plane.opposite(start + k)]);
                for (part, value) in [one.re, one.im, other.re, other.im].into_iter().enumerate() {
                    given[(channel, part * pairs + pair)] = value;
                }
            }
        }
        let mut out = vec![[Complex::default(); 2]; self.rows * pairs * blocks.len()];
        for (k, (block, given)) in blocks.iter().zip(&given).enumerate() {
            fluxform_base::progress::poll();
            let product = block * given;
            for pair in 0..pairs {
                for row in 0..self.rows {
                    let at = |part: usize| {
                        let column = part * pairs + pair;
                        (product[(row, column)], product[(self.rows + row, column)])
                    };
                    // Blocks of opposite frequencies are conjugate.
                    let ([re, im], [opposite_re, opposite_im]) = ([at(0), at(1)], [at(2), at(3)]);
                    out[(pair * self.rows + row) * blocks.len() + k] = [
                        Complex::new(re.0 - im.1, im.0 + re.1),
                        Complex::new(opposite_re.0 + opposite_im.1, opposite_im.0 - opposite_re.1),
                    ];
                }
            }
        }
        out
    }
}

/// A periodic plane whose transform has the first axis last.
struct Plane {
    size: [usize; 2],
    /// Rows that hold cells; the others are there for steps across the end.
    rows: usize,
    forward: [Arc<dyn Fft<f64>>; 2],
    inverse: [Arc<dyn Fft<f64>>; 2],
}

impl Plane {
    fn new(size: [usize; 2], rows: usize) -> Self {
        let mut planner = FftPlanner::new();
        Self {
            size,
            rows,
            forward: size.map(|n| planner.plan_fft_forward(n)),
            inverse: size.map(|n| planner.plan_fft_inverse(n)),
        }
    }

    fn size(&self) -> usize {
        self.size[0] * self.size[1]
    }

    fn place(&self, step: [isize; 2]) -> usize {
        let [x, y] = [0, 1].map(|axis| step[axis].rem_euclid(self.size[axis] as isize) as usize);
        y * self.size[0] + x
    }

    /// Index of the opposite frequency.
    fn opposite(&self, k: usize) -> usize {
        let [nx, ny] = self.size;
        let (x, y) = (k / ny, k % ny);
        (nx - x) % nx * ny + (ny - y) % ny
    }

    /// Frequencies below which every one or its opposite is.
    fn half(&self) -> usize {
        (self.size[0] / 2 + 1) * self.size[1]
    }

    /// From places to frequencies; rows from `rows` on are zero.
    fn forward(&self, mut values: Vec<Complex<f64>>, rows: usize) -> Vec<Complex<f64>> {
        let [nx, ny] = self.size;
        self.forward[0].process(&mut values[..rows * nx]);
        let mut turned = vec![Complex::default(); values.len()];
        for (row, from) in values.chunks_exact(nx).take(rows).enumerate() {
            for (column, value) in from.iter().enumerate() {
                turned[column * ny + row] = *value;
            }
        }
        self.forward[1].process(&mut turned);
        turned
    }

    /// From frequencies to the rows that hold cells, without the factor of the size.
    fn back(&self, mut values: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
        let [nx, ny] = self.size;
        self.inverse[1].process(&mut values);
        let mut turned = vec![Complex::default(); self.rows * nx];
        for (column, from) in values.chunks_exact(ny).enumerate() {
            for (row, value) in from.iter().take(self.rows).enumerate() {
                turned[row * nx + column] = *value;
            }
        }
        self.inverse[0].process(&mut turned);
        turned
    }
}

/// The least number from `least` up without prime factors above five.
fn smooth(least: usize) -> usize {
    (least..)
        .find(|n| {
            let mut left = *n;
            for prime in [2, 3, 5] {
                while left % prime == 0 {
                    left /= prime;
                }
            }
            left == 1
        })
        .unwrap_or(least)
}
