//! The field of a magnetised core, with or without its winding, as a table over the half plane.
//!
//! The table consists of square cells of size s on a grid of size s, s a power of two. A point at
//! distance d from the nearest source belongs to the cell of the largest s with (1 + sqrt(2)) s <= d
//! that holds it, so every cell is at least s away from all sources, whatever cell a neighbour
//! belongs to. In either coordinate the nearest singularity then is s off an interval of
//! half-width s/2 or more: Bernstein radius 2 + sqrt(5). A cell is a product of Chebyshev series,
//! computed from the exact field when a point first falls into it. What a point's value is thus
//! depends on the point alone. Points closer than `NEAREST` to a source get the exact field.

use crate::components::Components;
use std::collections::HashMap;
use std::f64::consts::{PI, SQRT_2};
use std::sync::{Arc, OnceLock, PoisonError, RwLock};

use super::magnetized::MagnetizedCore;
use super::magnetized::loops::{LoopFields, Rectangle};
use crate::batch::Gradients;
use crate::source::AxialSource;
use crate::winding::{AxialField, OnEdge, Winding};
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::dispatch::{self, Kernel};

/// Points closer to a source than this multiple of the core's radius get the exact field.
const NEAREST: f64 = 0.01;
/// Constant of the bound `SCALE * radius^-terms` of a cell's error, relative to |grad B| there.
const SCALE: f64 = 100.0;
/// Terms beyond which the exact field is cheaper.
const MOST_TERMS: usize = 24;
/// Share of the tolerance given to a cell's values: of the loops that stand for the core, and of the
/// winding.
const SHARE: f64 = 0.1;
/// Rounding of a loop's field, relative to its own size, in units of its radius over its distance.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// The gradient's components, in the order in which cells hold them.
const GRADIENT: [Quantity; 3] = [Quantity::DbzDz, Quantity::DbrDzOverR, Quantity::BrOverR];

/// Values of a table at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// B_z, T.
    Bz,
    /// dB_z/dz, T/m.
    DbzDz,
    /// (dB_r/dz)/r, T/m^2.
    DbrDzOverR,
    /// B_r/r, T/m.
    BrOverR,
}

/// A core, with or without its winding, per ampere; standing at the origin.
#[derive(Debug)]
pub struct AxialTable {
    winding: Option<Winding>,
    core: MagnetizedCore,
    tolerance: f64,
    terms: usize,
    cells: RwLock<HashMap<Key, Arc<Cell>>>,
}

/// Exponent of the cell's size and the cell's place along r and z.
type Key = (i32, i64, i64);

/// Coefficients [quantity][degree in z][degree in r], once they are computed: B_z apart, which few
/// ask for.
#[derive(Debug, Default)]
struct Cell {
    gradient: OnceLock<Result<Vec<f64>, OnEdge>>,
    b_z: OnceLock<Result<Vec<f64>, OnEdge>>,
}

/// A point's cell and its place there, -1 to 1 along r and z.
struct CellPosition {
    key: Key,
    x: f64,
    y: f64,
}

impl AxialTable {
    /// The table with errors below `tolerance` of |grad B| at the point (of |B| for the field).
    #[must_use]
    pub fn new(winding: Option<Winding>, core: MagnetizedCore, tolerance: f64) -> Self {
        let radius = 2.0 + 5.0_f64.sqrt();
        let terms = ((SCALE / tolerance).ln() / radius.ln()).ceil().max(4.0) as usize;
        Self {
            winding,
            core,
            tolerance,
            terms,
            cells: RwLock::default(),
        }
    }

    /// The field itself, without the table.
    ///
    /// # Errors
    /// A point on the winding's edge.
    pub fn exact(&self, r_m: f64, z_m: f64) -> Result<AxialField, OnEdge> {
        let steel = self.core.field(r_m, z_m);
        Ok(match &self.winding {
            Some(winding) => winding.field(r_m, z_m)? + steel,
            None => steel,
        })
    }

    /// `requested` at the points (`r_m`, `z_m`), `[quantity][point]`.
    ///
    /// # Errors
    /// A point on the winding's edge.
    ///
    /// # Panics
    /// When the two slices differ in length.
    pub fn sample(
        &self,
        r_m: &[f64],
        z_m: &[f64],
        requested: &[Quantity],
    ) -> Result<Vec<Vec<f64>>, OnEdge> {
        assert_eq!(r_m.len(), z_m.len(), "one height per radius");
        let mut out = vec![Vec::with_capacity(r_m.len()); requested.len()];
        let mut last: Option<(Key, Arc<Cell>)> = None;
        // The series in the radius at the height of the point before, [quantity][degree], in its cell.
        let mut rows = vec![[0.0; MOST_TERMS]; requested.len()];
        let mut rows_of: Option<(Key, f64)> = None;
        for (r, z) in r_m.iter().zip(z_m) {
            let Some(place) = self.place(*r, *z) else {
                let field = self.exact(*r, *z)?;
                for (values, quantity) in out.iter_mut().zip(requested) {
                    values.push(quantity.of(&field));
                }
                continue;
            };
            let cell = match &last {
                Some((key, cell)) if *key == place.key => cell,
                Some(_) | None => &last.insert((place.key, self.cell(place.key))).1,
            };
            if rows_of != Some((place.key, place.y)) {
                let along_z = polynomials(place.y);
                for (row, quantity) in rows.iter_mut().zip(requested) {
                    dispatch::run(Row {
                        coefficients: self.series(place.key, cell, *quantity)?,
                        along_z: &along_z[..self.terms],
                        row: &mut row[..self.terms],
                    });
                }
                rows_of = Some((place.key, place.y));
            }
            let along_r = polynomials(place.x);
            for (values, row) in out.iter_mut().zip(&rows) {
                let terms = row.iter().zip(&along_r).take(self.terms);
                values.push(terms.map(|(a, b)| a * b).sum());
            }
        }
        Ok(out)
    }

    /// `parts` at `points_m`, into `out`, [component, point], in the order of [`Components`]; away from
    /// the winding's conductor, if the table has one.
    ///
    /// # Errors
    /// A point on the winding's edge.
    ///
    /// # Panics
    /// When `out` has another length than components x points.
    pub fn sample_parts(
        &self,
        points_m: &[[f64; 3]],
        parts: Components,
        out: &mut [f64],
    ) -> Result<(), OnEdge> {
        let count = points_m.len();
        assert_eq!(out.len(), parts.count() * count);
        let r_m: Vec<f64> = points_m.iter().map(|[x, y, _]| x.hypot(*y)).collect();
        let z_m: Vec<f64> = points_m.iter().map(|p| p[2]).collect();
        let requested: &[Quantity] = match parts {
            Components::Gz => {
                let values = self.sample(&r_m, &z_m, &[Quantity::DbzDz])?;
                out.copy_from_slice(&values[0]);
                return Ok(());
            }
            Components::Force | Components::Gradient => &GRADIENT,
            Components::All => &[
                Quantity::DbzDz,
                Quantity::DbrDzOverR,
                Quantity::BrOverR,
                Quantity::Bz,
            ],
        };
        let values = self.sample(&r_m, &z_m, requested)?;
        // Of the force those along z alone, the gradient's last.
        let first = if parts == Components::Force { 2 } else { 0 };
        for (place, [x, y, _]) in points_m.iter().enumerate() {
            let (zz, slope, ratio) = (values[0][place], values[1][place], values[2][place]);
            // dB_r/dr = -B_r/r - dB_z/dz; along the direction of r the tensor is that, across B_r/r.
            let square = r_m[place] * r_m[place];
            let turn = if square > 0.0 {
                -(2.0 * ratio + zz) / square
            } else {
                0.0
            };
            let mut put = |component: usize, value: f64| {
                if let Some(component) = component.checked_sub(first) {
                    out[component * count + place] = value;
                }
            };
            put(0, ratio + turn * x * x);
            put(1, turn * x * y);
            put(2, slope * x);
            put(3, slope * y);
            put(4, zz);
            if parts == Components::All {
                put(5, ratio * x);
                put(6, ratio * y);
                put(7, values[3][place]);
            }
        }
        Ok(())
    }

    /// The cell of a point; `None` where the exact field is due.
    fn place(&self, r_m: f64, z_m: f64) -> Option<CellPosition> {
        let shape = self.core.outline().shape;
        let mut distance_m = shape.distance_m(r_m, z_m);
        if let Some(winding) = &self.winding {
            let across = (winding.inner_radius_m - r_m).max(r_m - winding.outer_radius_m);
            let along = z_m.max(-winding.length_m - z_m);
            distance_m = distance_m.min(across.max(0.0).hypot(along.max(0.0)));
        }
        let nearest_m = NEAREST * shape.radius_m;
        if self.terms > MOST_TERMS || distance_m < nearest_m || !distance_m.is_finite() {
            return None;
        }
        let exponent = (distance_m / (1.0 + SQRT_2)).log2().floor() as i32;
        let size_m = 2.0_f64.powi(exponent);
        let (i, j) = ((r_m / size_m).floor(), (z_m / size_m).floor());
        Some(CellPosition {
            key: (exponent, i as i64, j as i64),
            x: 2.0 * (r_m / size_m - i) - 1.0,
            y: 2.0 * (z_m / size_m - j) - 1.0,
        })
    }

    /// The cell, perhaps still empty: who needs it first computes it while others wait.
    fn cell(&self, key: Key) -> Arc<Cell> {
        let known = |cells: &HashMap<Key, Arc<Cell>>| cells.get(&key).cloned();
        let read = self.cells.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(cell) = known(&read) {
            return cell;
        }
        drop(read);
        let mut cells = self.cells.write().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(cells.entry(key).or_default())
    }

    /// The coefficients of one quantity in a cell.
    fn series<'a>(
        &self,
        key: Key,
        cell: &'a Cell,
        quantity: Quantity,
    ) -> Result<&'a [f64], OnEdge> {
        let (series, place) = match quantity {
            Quantity::Bz => (&cell.b_z, 0),
            Quantity::DbzDz => (&cell.gradient, 0),
            Quantity::DbrDzOverR => (&cell.gradient, 1),
            Quantity::BrOverR => (&cell.gradient, 2),
        };
        let held = if quantity == Quantity::Bz {
            &[Quantity::Bz][..]
        } else {
            &GRADIENT
        };
        let series = series.get_or_init(|| self.computed(key, held));
        let size = self.terms * self.terms;
        let series = series.as_ref().map_err(|on_edge| *on_edge)?;
        Ok(&series[place * size..][..size])
    }

    /// Values of `held` at points of a rectangle, `[quantity][point]`.
    fn values(
        &self,
        rectangle: Rectangle,
        (r_m, z_m): (&[f64], &[f64]),
        held: &[Quantity],
    ) -> Result<Vec<f64>, OnEdge> {
        let size_m = rectangle.r_m[1] - rectangle.r_m[0];
        let tolerance = SHARE * self.tolerance;
        let rounding = ROUNDING * (self.core.outline().shape.radius_m / size_m).max(1.0);
        let loops = if rounding <= 0.1 * self.tolerance {
            self.core.loops(rectangle, tolerance)
        } else {
            None
        };
        let Some(loops) = loops else {
            let fields = r_m.iter().zip(z_m).map(|(r, z)| self.exact(*r, *z));
            let fields: Vec<AxialField> = fields.collect::<Result<_, _>>()?;
            let of =
                |quantity: &Quantity| fields.iter().map(|f| quantity.of(f)).collect::<Vec<_>>();
            return Ok(held.iter().flat_map(of).collect());
        };
        let core = loops.fields(r_m, z_m);
        let mut values: Vec<f64> = held
            .iter()
            .flat_map(|q| q.of_loops(&core))
            .copied()
            .collect();
        values.iter_mut().for_each(|value| *value *= MU_0_T_M_PER_A);
        let Some(winding) = &self.winding else {
            return Ok(values);
        };
        let own = if held.contains(&Quantity::Bz) {
            winding.axial_fields(r_m, z_m, tolerance)?
        } else {
            let own = winding.gradients(r_m, z_m, tolerance, Components::Gradient)?;
            [own.dbz_dz, own.dbr_dz_over_r, own.br_over_r].concat()
        };
        for (value, own) in values.iter_mut().zip(own) {
            *value += own;
        }
        Ok(values)
    }

    fn computed(&self, (exponent, i, j): Key, held: &[Quantity]) -> Result<Vec<f64>, OnEdge> {
        let n = self.terms;
        let size_m = 2.0_f64.powi(exponent);
        let node = |k: usize| (PI * (k as f64 + 0.5) / n as f64).cos();
        let at = |place: i64, k: usize| size_m * (place as f64 + 0.5 * (1.0 + node(k)));
        let nodes = (0..n * n).map(|place| (at(i, place % n), at(j, place / n)));
        let (r_m, z_m): (Vec<f64>, Vec<f64>) = nodes.unzip();
        let range = |place: i64| [size_m * place as f64, size_m * (place + 1) as f64];
        let rectangle = Rectangle {
            r_m: range(i),
            z_m: range(j),
        };
        let values = self.values(rectangle, (&r_m, &z_m), held)?;
        // Values to coefficients, along r and then along z.
        let transform: Vec<f64> = (0..n * n)
            .map(|index| {
                let (degree, k) = (index / n, index % n);
                let scale = if degree == 0 { 1.0 } else { 2.0 } / n as f64;
                scale * (PI * degree as f64 * (k as f64 + 0.5) / n as f64).cos()
            })
            .collect();
        let mut coefficients = vec![0.0; values.len()];
        for (values, coefficients) in values
            .chunks_exact(n * n)
            .zip(coefficients.chunks_exact_mut(n * n))
        {
            let mut along_r = vec![0.0; n * n];
            for row in 0..n {
                for degree in 0..n {
                    along_r[row * n + degree] = (0..n)
                        .map(|k| transform[degree * n + k] * values[row * n + k])
                        .sum();
                }
            }
            for degree in 0..n {
                for column in 0..n {
                    coefficients[degree * n + column] = (0..n)
                        .map(|k| transform[degree * n + k] * along_r[k * n + column])
                        .sum();
                }
            }
        }
        Ok(coefficients)
    }
}

/// A product of two Chebyshev series at one height: a series in the radius.
struct Row<'a> {
    /// [degree in z][degree in r]
    coefficients: &'a [f64],
    along_z: &'a [f64],
    /// One number per degree in r.
    row: &'a mut [f64],
}

impl Kernel for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        self.row.fill(0.0);
        let by_row = self.coefficients.chunks_exact(self.row.len());
        for (row, factor) in by_row.zip(self.along_z) {
            for (sum, coefficient) in self.row.iter_mut().zip(row) {
                *sum = if FMA {
                    factor.mul_add(*coefficient, *sum)
                } else {
                    factor * coefficient + *sum
                };
            }
        }
    }
}

impl Quantity {
    fn of(self, field: &AxialField) -> f64 {
        match self {
            Self::Bz => field.b_z,
            Self::DbzDz => field.dbz_dz,
            Self::DbrDzOverR => field.dbr_dz_over_r,
            Self::BrOverR => field.br_over_r,
        }
    }

    fn of_loops(self, fields: &LoopFields) -> &[f64] {
        match self {
            Self::Bz => &fields.b_z,
            Self::DbzDz => &fields.dbz_dz,
            Self::DbrDzOverR => &fields.dbr_dz_over_r,
            Self::BrOverR => &fields.br_over_r,
        }
    }
}

/// T_0 to T_(MOST_TERMS - 1).
fn polynomials(x: f64) -> [f64; MOST_TERMS] {
    let mut values = [1.0; MOST_TERMS];
    values[1] = x;
    for k in 2..MOST_TERMS {
        values[k] = 2.0 * x * values[k - 1] - values[k - 2];
    }
    values
}

impl AxialSource for AxialTable {
    fn gradients(
        &self,
        r_m: &[f64],
        z_m: &[f64],
        _tolerance: f64,
        components: Components,
    ) -> Result<Gradients, OnEdge> {
        let quantities: &[Quantity] = match components {
            Components::Gz => &[Quantity::DbzDz],
            Components::Force | Components::Gradient | Components::All => &GRADIENT,
        };
        let mut values = self.sample(r_m, z_m, quantities)?.into_iter();
        let mut next = || values.next().unwrap_or_default();
        Ok(Gradients {
            dbz_dz: next(),
            dbr_dz_over_r: next(),
            br_over_r: next(),
        })
    }

    fn axial_fields(&self, r_m: &[f64], z_m: &[f64], _tolerance: f64) -> Result<Vec<f64>, OnEdge> {
        Ok(self.sample(r_m, z_m, &[Quantity::Bz])?.swap_remove(0))
    }

    fn top_m(&self) -> f64 {
        let top_m = self.core.outline().shape.top_m;
        self.winding.map_or(top_m, |_| top_m.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::to_cartesian;
    use crate::steel::CoreShape;
    use crate::steel::cored_coil::CoredCoil;

    #[test]
    fn it_is_the_winding_and_its_core_on_the_axis_and_off_whatever_the_other_points() {
        let winding = Winding {
            inner_radius_m: 0.012,
            outer_radius_m: 0.019,
            length_m: 0.05,
            turns: 700.0,
        };
        let shape = CoreShape {
            radius_m: 0.011,
            bottom_m: -0.053,
            top_m: 0.001,
        };
        let coil = CoredCoil::everywhere(&winding, shape, 300.0, 1e-3).expect("off the edges");
        let places = [
            [0.0, 0.0, 0.03],
            [1e-9, 0.0, 0.034],
            [0.0, 0.002, 0.0021],
            [0.0113, 0.003, 0.0017],
            [-0.031, 0.011, 0.05],
            [0.023, -0.001, -0.017],
            [0.0, 0.0, 0.00125],
        ];
        for tolerance in [1e-3, 1e-6, 1e-9] {
            let table = AxialTable::new(Some(winding), coil.core.clone(), tolerance);
            let mut all = vec![0.0; 8 * places.len()];
            table
                .sample_parts(&places, Components::All, &mut all)
                .expect("off the edges");
            for (place, point) in places.iter().enumerate() {
                let r_m = point[0].hypot(point[1]);
                let axial = coil.field(r_m, point[2]).expect("off the edges");
                let exact = to_cartesian(&axial, point[0], point[1]);
                let (g, b) = (exact.gradient_t_per_m_per_a, exact.field_t_per_a);
                let requested = [
                    g[0][0], g[0][1], g[0][2], g[1][2], g[2][2], b[0], b[1], b[2],
                ];
                let sizes = [axial.gradient_norm(), axial.b_r.hypot(axial.b_z)];
                for (component, requested) in requested.into_iter().enumerate() {
                    let size = sizes[usize::from(component >= 5)];
                    let error = (all[component * places.len() + place] - requested).abs() / size;
                    assert!(error < tolerance, "{point:?} {component}: {error:e}");
                }
                let alone = AxialTable::new(Some(winding), coil.core.clone(), tolerance);
                let mut one = vec![0.0; 8];
                alone
                    .sample_parts(&[*point], Components::All, &mut one)
                    .expect("off the edges");
                for (component, value) in one.into_iter().enumerate() {
                    assert_eq!(value, all[component * places.len() + place]);
                }
            }
            assert_eq!(AxialSource::top_m(&table), 0.001);
        }
    }
}
