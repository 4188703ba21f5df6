//! Bodies placed in bodies: an assembly's tree laid out as triangles, bounded.

use crate::file_mesh::Triangle;

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

/// Lays out `roots`: every triangle of the bodies below, placed.
///
/// # Errors
/// A body within itself, too many triangles, bodies nested too deep.
pub(super) fn lay_out(bodies: &[Body], roots: &[(usize, Affine)]) -> Result<Vec<Triangle>, String> {
    let mut visits = vec![None; bodies.len()];
    // Bodies within themselves are a fault of the file also where nothing places them.
    for body in 0..bodies.len() {
        weight(bodies, body, &mut visits, 0)?;
    }
    let mut total = Weight::default();
    for (root, _) in roots {
        total.add(weight(bodies, *root, &mut visits, 0)?);
    }
    let own: u64 = bodies.iter().map(|body| body.triangles.len() as u64).sum();
    if total.triangles > own + MOST_ADDED || total.placements > MOST_PLACEMENTS {
        return Err(format!(
            "the placed bodies add up to more than the file's {own} triangles and {MOST_ADDED} \
             copies of them, or {MOST_PLACEMENTS} placements; export fewer bodies or a coarser mesh"
        ));
    }
    let mut triangles = Vec::with_capacity(usize::try_from(total.triangles).unwrap_or(0));
    for (root, place) in roots {
        add(bodies, *root, place, &mut triangles);
    }
    let mut coordinates = triangles.as_flattened().as_flattened().iter();
    if coordinates.any(|c| !c.is_finite()) {
        return Err("a placement moves a body beyond all numbers".into());
    }
    Ok(triangles)
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

fn add(bodies: &[Body], index: usize, place: &Affine, triangles: &mut Vec<Triangle>) {
    let body = &bodies[index];
    if *place == Affine::IDENTITY {
        triangles.extend_from_slice(&body.triangles);
    } else {
        triangles.extend(body.triangles.iter().map(|t| t.map(|v| place.apply(v))));
    }
    for (child, inner) in &body.children {
        add(bodies, *child, &place.after(inner), triangles);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
                let found = lay_out(&bodies, &[(root, Affine::IDENTITY)]);
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
        assert!(lay_out(&bodies, &roots).unwrap_err().contains("more than"));
        bodies[39].children.push((3, Affine::IDENTITY));
        assert!(
            lay_out(&bodies, &roots)
                .unwrap_err()
                .contains("within itself")
        );
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
        assert_eq!(lay_out(&bodies, &roots), Ok(Vec::new()));
        roots.push((0, Affine::IDENTITY));
        assert!(lay_out(&bodies, &roots).unwrap_err().contains("placements"));
    }
}
