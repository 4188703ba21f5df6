//! Bodies placed in bodies: an assembly's tree laid out as triangles, bounded.

use crate::file_mesh::{FileMesh, Triangle};
use crate::memory;
use crate::number::{F32_ROUNDING, Numbers};
use fluxform_numerics::vec3::{cross, dot};

/// Placing bodies several times may add so many triangles to those of the file,
const MOST_ADDED: u64 = 10_000_000;
/// by so many placements: a small file must not fill a computer.
const MOST_PLACEMENTS: u64 = 1_000_000;
/// Placements nested deeper than this belong to no part.
const DEEPEST: usize = 64;

/// x' = a x + shift: the linear part by rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Affine {
    pub(super) rows: [[f64; 3]; 3],
    pub(super) shift: [f64; 3],
}

impl Affine {
    pub(super) const IDENTITY: Self = Self {
        rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        shift: [0.0; 3],
    };

    /// From the images of the three axes and of the origin, twelve numbers: how 3MF and 3DXML
    /// write it.
    pub(super) fn from_columns(c: [f64; 12]) -> Self {
        Self {
            rows: [0, 1, 2].map(|k| [c[k], c[3 + k], c[6 + k]]),
            shift: [c[9], c[10], c[11]],
        }
    }

    pub(super) fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| {
            let row = self.rows[k];
            row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + self.shift[k]
        })
    }

    /// First `inner`, then this.
    pub(super) fn after(&self, inner: &Self) -> Self {
        let column = |k: usize| [0, 1, 2].map(|i| inner.rows[i][k]);
        let turned = |p: [f64; 3]| {
            self.rows
                .map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2])
        };
        let columns = [0, 1, 2].map(|k| turned(column(k)));
        Self {
            rows: [0, 1, 2].map(|i| [0, 1, 2].map(|k| columns[k][i])),
            shift: self.apply(inner.shift),
        }
    }

    /// Whether it turns what looks outwards inside out.
    fn mirrors(&self) -> bool {
        let [a, b, c] = self.rows;
        dot(a, cross(b, c)) < 0.0
    }

    /// The magnitudes of its numbers.
    pub(super) fn magnitudes(&self) -> Self {
        Self {
            rows: self.rows.map(|row| row.map(f64::abs)),
            shift: self.shift.map(f64::abs),
        }
    }

    /// How far its numbers may lie from what was meant, each a magnitude: of a shift the share `epsilon`
    /// of it, of a turn or a factor that is no whole number the same share of the largest.
    fn roundings(&self, epsilon: f64) -> Self {
        let Self { rows, shift } = self.magnitudes();
        let largest = rows.as_flattened().iter().fold(0.0, |m: f64, v| m.max(*v));
        let of = |v: f64| {
            if v.fract() == 0.0 {
                0.0
            } else {
                epsilon * largest
            }
        };
        Self {
            rows: rows.map(|row| row.map(of)),
            shift: shift.map(|v| epsilon * v),
        }
    }
}

/// A composed placement, and how far its numbers may lie from what was meant.
#[derive(Clone, Copy)]
struct Placed {
    place: Affine,
    roundings: Affine,
}

impl Placed {
    fn new(place: Affine, epsilon: f64) -> Self {
        Self {
            place,
            roundings: place.roundings(epsilon),
        }
    }

    /// First `inner`, then this: what the numbers of each are off goes through those of the other.
    fn after(&self, inner: &Self) -> Self {
        let linear = Affine {
            shift: [0.0; 3],
            ..self.place.magnitudes()
        };
        let (own, outer) = (
            linear.after(&inner.roundings),
            self.roundings.after(&inner.place.magnitudes()),
        );
        let sum = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| a[k] + b[k]);
        Self {
            place: self.place.after(&inner.place),
            roundings: Affine {
                rows: [0, 1, 2].map(|k| sum(own.rows[k], outer.rows[k])),
                shift: sum(own.shift, outer.shift),
            },
        }
    }

    /// How far a coordinate may lie from what was meant once it is placed: before, it was `own` for coordinates
    /// up to `far`.
    fn rounding(&self, own: f64, far: [f64; 3]) -> f64 {
        let linear = Affine {
            shift: [0.0; 3],
            ..self.place.magnitudes()
        };
        let (read, placed) = (linear.apply([own; 3]), self.roundings.apply(far));
        [0, 1, 2]
            .map(|k| read[k] + placed[k])
            .into_iter()
            .fold(0.0, f64::max)
    }
}

/// A body of an assembly: its own triangles, and bodies placed in it.
#[derive(Debug, Clone, Default)]
pub(super) struct Body {
    pub(super) triangles: Vec<Triangle>,
    pub(super) children: Vec<(usize, Affine)>,
}

/// The vertex of a triangle's index.
///
/// # Errors
/// An index without a vertex.
pub(super) fn corner(vertices: &[[f64; 3]], index: usize) -> Result<[f64; 3], String> {
    vertices.get(index).copied().ok_or_else(|| {
        format!(
            "a triangle has the index {index}, but its object has {} vertices (indices count from \
             0)",
            vertices.len()
        )
    })
}

/// How finely a file gives its numbers.
#[derive(Clone, Copy)]
pub(super) enum Fineness<'a> {
    /// As doubles; what else they are off is measured.
    Doubles,
    /// As floats.
    Floats,
    /// As text.
    Printed(&'a Numbers),
}

impl Fineness<'_> {
    /// The rounding of coordinates of which these are the largest along each axis.
    pub(super) fn rounding(self, far: [f64; 3]) -> f64 {
        match self {
            Self::Doubles => 0.0,
            Self::Floats => far[0].max(far[1]).max(far[2]) * F32_ROUNDING,
            Self::Printed(numbers) => numbers.rounding(),
        }
    }

    /// The rounding of a placement's numbers, relative.
    fn epsilon(self) -> f64 {
        match self {
            Self::Doubles => 0.0,
            Self::Floats => F32_ROUNDING,
            Self::Printed(numbers) => numbers.epsilon(),
        }
    }
}

/// Lays out `roots`: every triangle of the bodies below, placed, and how far its coordinates may lie from
/// what was meant: what cancels in a placement leaves its rounding.
///
/// # Errors
/// A body within itself, too many triangles, bodies nested too deep.
pub(super) fn lay_out(
    bodies: &[Body],
    roots: &[(usize, Affine)],
    fineness: Fineness<'_>,
) -> Result<FileMesh, String> {
    let mut visits = vec![None; bodies.len()];
    // Bodies within themselves are a fault of the file also where nothing places them.
    for body in 0..bodies.len() {
        weight(bodies, body, &mut visits, 0)?;
    }
    let mut total = Weight::default();
    for (root, _) in roots {
        total.add(weight(bodies, *root, &mut visits, 0)?);
    }
    let in_file: u64 = bodies.iter().map(|body| body.triangles.len() as u64).sum();
    if total.triangles > in_file + MOST_ADDED || total.placements > MOST_PLACEMENTS {
        return Err(format!(
            "the placed bodies add up to more than the file's {in_file} triangles and {MOST_ADDED} \
             copies of them, or {MOST_PLACEMENTS} placements; export fewer bodies or a coarser mesh"
        ));
    }
    memory::check(total.triangles)?;
    let read = |body: &Body| {
        let far = farthest(&body.triangles);
        (fineness.rounding(far), far)
    };
    let epsilon = fineness.epsilon();
    let assembly = Assembly {
        bodies,
        read: bodies.iter().map(read).collect(),
        epsilon,
    };
    let mut laid_out = FileMesh {
        triangles: Vec::with_capacity(usize::try_from(total.triangles).unwrap_or(0)),
        ..FileMesh::default()
    };
    for (root, place) in roots {
        assembly.add(*root, &Placed::new(*place, epsilon), &mut laid_out);
    }
    let mut coordinates = laid_out.triangles.as_flattened().as_flattened().iter();
    if coordinates.any(|c| !c.is_finite()) {
        return Err("a placement moves a body beyond all numbers".into());
    }
    Ok(laid_out)
}

/// The largest magnitude along each axis.
pub(super) fn farthest(triangles: &[Triangle]) -> [f64; 3] {
    let corners = triangles.as_flattened().iter();
    corners.fold([0.0; 3], |far: [f64; 3], p| {
        [0, 1, 2].map(|k| far[k].max(p[k].abs()))
    })
}

/// How many triangles [`lay_out`] makes of each root.
pub(super) fn counts(bodies: &[Body], roots: &[(usize, Affine)]) -> Vec<usize> {
    let mut visits = vec![None; bodies.len()];
    let mut below = |root: &usize| weight(bodies, *root, &mut visits, 0).map_or(0, |w| w.triangles);
    let roots = roots.iter().map(|(root, _)| below(root));
    roots.map(|count| count as usize).collect()
}

/// The bodies below a body.
#[derive(Clone, Copy, Default)]
struct Weight {
    triangles: u64,
    placements: u64,
    /// Bodies in one another, this one not counted.
    depth: usize,
}

impl Weight {
    fn add(&mut self, other: Self) {
        self.triangles = self.triangles.saturating_add(other.triangles);
        self.placements = self.placements.saturating_add(other.placements);
        self.depth = self.depth.max(other.depth + 1);
    }
}

#[derive(Clone, Copy)]
enum Visit {
    Open,
    Weighs(Weight),
}

/// Triangles and placements below a body, each body computed once.
fn weight(
    bodies: &[Body],
    index: usize,
    visits: &mut [Option<Visit>],
    depth: usize,
) -> Result<Weight, String> {
    let too_deep = || Err(format!("bodies are nested more than {DEEPEST} deep"));
    match visits[index] {
        Some(Visit::Weighs(weight)) => return Ok(weight),
        Some(Visit::Open) => return Err("a body is placed within itself".into()),
        None if depth > DEEPEST => return too_deep(),
        None => visits[index] = Some(Visit::Open),
    }
    let mut sum = Weight {
        triangles: bodies[index].triangles.len() as u64,
        placements: 1,
        depth: 0,
    };
    for (child, _) in &bodies[index].children {
        sum.add(weight(bodies, *child, visits, depth + 1)?);
    }
    // A body whose weight is known was not gone into.
    if sum.depth > DEEPEST {
        return too_deep();
    }
    visits[index] = Some(Visit::Weighs(sum));
    Ok(sum)
}

/// Bodies that are laid out.
struct Assembly<'a> {
    bodies: &'a [Body],
    /// The rounding of each body's own coordinates, and the largest of them.
    read: Vec<(f64, [f64; 3])>,
    epsilon: f64,
}

impl Assembly<'_> {
    fn add(&self, index: usize, placed: &Placed, laid_out: &mut FileMesh) {
        let (body, place) = (&self.bodies[index], &placed.place);
        let triangles = &mut laid_out.triangles;
        if *place == Affine::IDENTITY {
            triangles.extend_from_slice(&body.triangles);
        } else {
            let mirrors = place.mirrors();
            triangles.extend(body.triangles.iter().map(|triangle| {
                let [a, b, c] = triangle.map(|v| place.apply(v));
                if mirrors { [a, c, b] } else { [a, b, c] }
            }));
        }
        if !body.triangles.is_empty() {
            let (own, far) = self.read[index];
            let rounding = placed.rounding(own, far);
            laid_out.coordinate_rounding = laid_out.coordinate_rounding.max(rounding);
        }
        for (child, inner) in &body.children {
            let inner = Placed::new(*inner, self.epsilon);
            self.add(*child, &placed.after(&inner), laid_out);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_numerics::vec3::minus;

    fn of(bodies: &[Body], roots: &[(usize, Affine)]) -> Result<FileMesh, String> {
        lay_out(bodies, roots, Fineness::Floats)
    }

    /// A placement that mirrors turned bodies inside out.
    #[test]
    fn regression_what_is_mirrored_was_inside_out() {
        let body = Body {
            triangles: vec![[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]],
            children: Vec::new(),
        };
        let mut mirrored = Affine::IDENTITY;
        mirrored.rows[0][0] = -1.0;
        let up = |place: Affine| {
            let file = of(std::slice::from_ref(&body), &[(0, place)]).unwrap();
            let [a, b, c] = file.triangles[0];
            cross(minus(b, a), minus(c, a))[2]
        };
        assert_eq!([up(Affine::IDENTITY), up(mirrored)], [1.0, 1.0]);
    }

    /// Numbers that cancelled took their roundings along: of a part read far away nothing was stated.
    #[test]
    fn what_cancels_leaves_its_rounding() {
        let body = Body {
            triangles: vec![[[3000.0, 0.7, 1.3]; 3]],
            children: Vec::new(),
        };
        let shifted = |shift: f64| Affine {
            shift: [shift, 0.0, 0.0],
            ..Affine::IDENTITY
        };
        let rounding = |bodies: &[Body], root, place| {
            of(bodies, &[(root, place)]).unwrap().coordinate_rounding / F32_ROUNDING
        };
        let still = [body.clone()];
        assert_eq!(rounding(&still, 0, Affine::IDENTITY), 3000.0);
        assert_eq!(rounding(&still, 0, shifted(-3000.0)), 6000.0);
        // Two shifts that undo each other, the inner one enlarged; and a turn, whose numbers are rounded too.
        let nested = [
            Body {
                triangles: Vec::new(),
                children: vec![(1, shifted(-3000.0))],
            },
            body,
        ];
        let twice = Affine {
            rows: [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]],
            ..shifted(70.0)
        };
        assert_eq!(rounding(&nested, 0, twice), 12_070.0);
        let turned = Affine {
            rows: [[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]],
            ..shifted(0.0)
        };
        let found = rounding(&still, 0, turned);
        assert!((found - (1.4 * 3000.0 + 3000.7)).abs() < 1e-9, "{found}");
    }

    #[test]
    fn placements_compose() {
        let a = Affine::from_columns([0.0, 1.0, 0.3, -1.0, 0.2, 0.0, 0.0, 0.7, 1.3, 5.0, 6.0, 7.0]);
        let b = Affine::from_columns([
            1.1, 0.0, 0.0, 0.4, 0.9, 0.0, 0.0, -0.6, 1.0, -2.0, 0.5, 0.25,
        ]);
        let p = [0.7, 1.3, -2.9];
        let (one, two) = (a.after(&b).apply(p), a.apply(b.apply(p)));
        for k in 0..3 {
            assert!((one[k] - two[k]).abs() < 1e-14);
        }
        assert_eq!(a.apply([1.0, 0.0, 0.0]), [5.0, 7.0, 7.3]);
    }

    /// Each body was gone into once, so a chain met from its end on was never found to be deep.
    #[test]
    fn a_chain_is_as_deep_from_either_end() {
        let chain = |length: usize, next: &dyn Fn(usize) -> Option<usize>| -> Vec<Body> {
            (0..length)
                .map(|k| Body {
                    triangles: vec![[[0.0; 3]; 3]],
                    children: next(k).map(|k| (k, Affine::IDENTITY)).into_iter().collect(),
                })
                .collect()
        };
        for (length, whole) in [(DEEPEST + 1, true), (DEEPEST + 2, false)] {
            let down = chain(length, &|k| (k + 1 < length).then_some(k + 1));
            let up = chain(length, &|k| k.checked_sub(1));
            for (bodies, root) in [(down, 0), (up, length - 1)] {
                let found = of(&bodies, &[(root, Affine::IDENTITY)]);
                assert_eq!(found.is_ok(), whole, "{length}");
            }
        }
    }

    #[test]
    fn what_grows_without_end_is_refused() {
        // Each of forty bodies holds the next twice.
        let mut bodies: Vec<Body> = (1..40)
            .map(|next| Body {
                triangles: Vec::new(),
                children: vec![(next, Affine::IDENTITY); 2],
            })
            .collect();
        bodies.push(Body::default());
        let roots = [(0, Affine::IDENTITY)];
        assert!(of(&bodies, &roots).unwrap_err().contains("more than"));
        bodies[39].children.push((3, Affine::IDENTITY));
        assert!(of(&bodies, &roots).unwrap_err().contains("within itself"));
    }

    #[test]
    fn as_many_placements_as_stated_are_laid_out() {
        let bodies = [
            Body::default(),
            Body {
                triangles: Vec::new(),
                children: vec![(0, Affine::IDENTITY); 999],
            },
        ];
        let mut roots = vec![(1, Affine::IDENTITY); 1000];
        assert_eq!(of(&bodies, &roots), Ok(FileMesh::default()));
        roots.push((0, Affine::IDENTITY));
        assert!(of(&bodies, &roots).unwrap_err().contains("placements"));
    }
}
