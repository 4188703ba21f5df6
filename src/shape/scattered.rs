//! Constraint points that lie on no grid: graded to a deviation, or blue noise.

pub mod adaptive;
pub mod poisson;

use std::sync::OnceLock;

use crate::deviation::{Faces, Lattice, Looks, Patch, Rect, Standing, primitive};
use crate::edges::{Edges, WELD_ROUNDINGS, weld};
use crate::error::ShapeError;
use crate::height::{Grid, Sample, reach_m};
use crate::index::Index;
use crate::memory::{self, POINT_BYTES};
use crate::mesh::Mesh;
use crate::point_areas::covered_share;
use crate::point_flags::{self, Marks, Rules};
use crate::primitive::PlacedPrimitive;
use crate::surface::Surface;

/// More points than this are refused, and those that take more memory than granted.
const MOST_POINTS: usize = 5_000_000;
/// Places a side at which a formula is looked for in a rectangle whose corners it leaves bare.
const LOOKED_FOR: usize = 8;

/// Points with the area each stands for; columns of equal length, sorted by y, then x.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scattered {
    /// x of each point, m.
    pub x_m: Vec<f64>,
    /// y of each point, m.
    pub y_m: Vec<f64>,
    /// Height of each point, m.
    pub height_m: Vec<f64>,
    /// Unit normal of each point, n_z >= 0.
    pub normal: Vec<[f64; 3]>,
    /// Flags of each point.
    pub marks: Vec<Marks>,
    /// Plan area each point stands for, m^2: its weight in a sum over the surface.
    pub weight_m2: Vec<f64>,
}

impl Scattered {
    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.x_m.len()
    }

    /// True without points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.x_m.is_empty()
    }

    fn push(&mut self, p: [f64; 2], (sample, marks): (Sample, Marks), weight_m2: f64) {
        self.x_m.push(p[0]);
        self.y_m.push(p[1]);
        self.height_m.push(sample.height_m);
        self.normal.push(sample.normal);
        self.marks.push(marks);
        self.weight_m2.push(weight_m2);
    }
}

/// A surface that answers at any point of the plan.
pub struct Probe<'a> {
    kind: Kind<'a>,
    plan_m: Rect,
    /// Of the surface, with its index.
    held_bytes: f64,
}

enum Kind<'a> {
    Mesh {
        mesh: &'a Mesh,
        index: Index,
        /// Sorted when they are first asked for: points of a grid need none.
        faces: Box<OnceLock<Faces>>,
        grid: Grid,
        rules: Rules,
    },
    Primitive(&'a PlacedPrimitive),
}

impl<'a> Probe<'a> {
    /// Prepares a surface over the region that `grid` spans.
    #[must_use]
    pub fn new(surface: &'a Surface, grid: &Grid) -> Self {
        let plan = grid.plan();
        let kind = match surface {
            Surface::Mesh(mesh) => {
                let reach = reach_m(mesh, grid);
                // Most files write a vertex the same way each time: the quick answer first.
                let closed = point_flags::is_closed(mesh.triangles()) || {
                    let rounding_m = mesh.facts().plan_rounding_m;
                    let names = weld(mesh.triangles(), WELD_ROUNDINGS * rounding_m);
                    Edges::new(&names).closed()
                };
                Kind::Mesh {
                    mesh,
                    index: Index::new(mesh, reach),
                    faces: Box::default(),
                    grid: *grid,
                    rules: Rules {
                        reach_m: reach,
                        plain_layers: 1 + u32::from(closed),
                    },
                }
            }
            Surface::Primitive(primitive) => Kind::Primitive(primitive),
        };
        Self {
            kind,
            held_bytes: surface.held_bytes(),
            plan_m: Rect {
                low_m: plan.map(|[low, _]| low),
                high_m: plan.map(|[_, high]| high),
            },
        }
    }

    /// Height, normal and marks over a point; `None` where there is no surface.
    #[must_use]
    pub fn at(&self, p: [f64; 2]) -> Option<(Sample, Marks)> {
        match &self.kind {
            Kind::Mesh {
                mesh, index, rules, ..
            } => point_flags::at(mesh.triangles(), index.at(p), p, *rules),
            Kind::Primitive(primitive) => Some((primitive.sample(p[0], p[1])?, Marks::PLAIN)),
        }
    }

    /// As [`Self::at`], without the flags.
    #[must_use]
    pub fn sample(&self, p: [f64; 2]) -> Option<Sample> {
        match &self.kind {
            Kind::Mesh {
                mesh, index, rules, ..
            } => point_flags::sample_at(mesh.triangles(), index.at(p), p, *rules),
            Kind::Primitive(primitive) => primitive.sample(p[0], p[1]),
        }
    }

    /// Whether there is surface over a point: as [`Self::sample`] has it.
    #[must_use]
    pub fn covers(&self, p: [f64; 2]) -> bool {
        match &self.kind {
            Kind::Mesh {
                mesh, index, rules, ..
            } => point_flags::is_met(mesh.triangles(), index.at(p), p, *rules),
            Kind::Primitive(primitive) => primitive.sample(p[0], p[1]).is_some(),
        }
    }

    /// How many triangles a look at a point compares it with.
    pub(super) fn near(&self, p: [f64; 2]) -> usize {
        match &self.kind {
            Kind::Mesh { index, .. } => index.at(p).len(),
            Kind::Primitive(_) => 1,
        }
    }

    /// A mesh's faces; `None` for a formula.
    fn sorted(&self) -> Option<&Faces> {
        match &self.kind {
            Kind::Mesh {
                mesh, faces, grid, ..
            } => Some(faces.get_or_init(|| Faces::new(mesh, grid, Looks::endless()))),
            Kind::Primitive(_) => None,
        }
    }

    /// Indices of the faces over the whole region; empty for a formula.
    fn faces(&self) -> Vec<u32> {
        let over = |faces: &Faces| faces.over(&self.plan_m, &faces.all());
        self.sorted().map_or_else(Vec::new, over)
    }

    /// Of `among`, the faces over a rectangle.
    fn faces_over(&self, rect: &Rect, among: &[u32]) -> Vec<u32> {
        let over = |faces: &Faces| faces.over(rect, among);
        self.sorted().map_or_else(Vec::new, over)
    }

    /// Whether a rectangle without point may still have surface over it.
    fn may_have_surface(&self, rect: &Rect, among: &[u32]) -> bool {
        match &self.kind {
            Kind::Mesh { .. } => !among.is_empty(),
            Kind::Primitive(primitive) => {
                let [width, depth] = rect.sides();
                primitive.distance_in_plan_m(rect.centre()) <= 0.5 * width.hypot(depth)
            }
        }
    }

    /// Whether the surface covers a rectangle whose corners it covers, but for what rounding leaves open.
    fn covers_all(&self, rect: &Rect, among: &[u32]) -> bool {
        match &self.kind {
            Kind::Mesh { rules, .. } => self
                .sorted()
                .is_some_and(|faces| faces.covered(rect, among, rules.reach_m)),
            // Every formula is convex in plan.
            Kind::Primitive(_) => true,
        }
    }

    /// The plan area of the surface over a rectangle, m^2.
    fn covered_m2(&self, rect: &Rect, among: &[u32]) -> f64 {
        match &self.kind {
            Kind::Mesh { .. } => self
                .sorted()
                .map_or(0.0, |faces| faces.covered_m2(rect, among)),
            Kind::Primitive(_) => {
                let [width, depth] = rect.sides();
                width * depth * covered_share(rect.corners(), &|p| self.covers(p))
            }
        }
    }

    /// The surface over a rectangle, with a place in it; `None` where there is none.
    fn standing(&self, rect: &Rect, among: &[u32]) -> Option<Standing> {
        if self.sorted().is_some() {
            return self.sorted()?.standing(rect, among);
        }
        let corners = rect.corners().into_iter();
        let mut places = corners.chain([rect.centre()]);
        let found = places.rfind(|p| self.covers(*p));
        let area_m2 = self.covered_m2(rect, among);
        if let Some(at_m) = found.filter(|_| area_m2 > 0.0) {
            return Some(Standing { at_m, area_m2 });
        }
        let (low_m, sides) = (rect.low_m, rect.sides());
        let part = |k: usize| (k as f64 + 0.5) / LOOKED_FOR as f64;
        let places = (0..LOOKED_FOR * LOOKED_FOR)
            .map(|k| [part(k % LOOKED_FOR), part(k / LOOKED_FOR)])
            .map(|[u, v]| [low_m[0] + u * sides[0], low_m[1] + v * sides[1]]);
        let covered: Vec<_> = places.filter(|p| self.covers(*p)).collect();
        let share = covered.len() as f64 / (LOOKED_FOR * LOOKED_FOR) as f64;
        covered.get(covered.len() / 2).map(|at_m| Standing {
            at_m: *at_m,
            area_m2: share * sides[0] * sides[1],
        })
    }

    /// A mesh's faces over each cell of `grid`, whose points have the heights `heights_m`; `None` for a formula.
    pub(super) fn lattice<'b>(
        &'b self,
        grid: &Grid,
        heights_m: &'b [Option<f64>],
    ) -> Option<Lattice<'b>> {
        let faces = self.sorted()?;
        Some(Lattice::new(faces, grid, heights_m))
    }

    /// A bound of the vertical difference between surface and patch, m.
    fn deviation_m(&self, patch: &Patch, among: &[u32]) -> f64 {
        match &self.kind {
            Kind::Mesh { .. } => self
                .sorted()
                .map_or(0.0, |faces| faces.deviation_m(patch, among)),
            Kind::Primitive(shape) => {
                let axis = |k: usize| fluxform_numerics::axis::Axis {
                    from: patch.rect.low_m[k],
                    to: patch.rect.high_m[k],
                    samples: 2,
                };
                let grid = Grid {
                    x_m: axis(0),
                    y_m: axis(1),
                };
                primitive(shape, &grid, &patch.corners_m.map(Some)).bound_m()
            }
        }
    }

    /// Checks a number of points that is needed at least, beside the surface.
    fn check_count(&self, points: usize, advice: &str) -> Result<(), ShapeError> {
        if points > MOST_POINTS {
            return Err(ShapeError::Document(format!(
                "more than {MOST_POINTS} points would be needed; {advice}"
            )));
        }
        let bytes = self.held_bytes + POINT_BYTES * points as f64;
        let what = format_args!("the surface and {points} points");
        memory::within(bytes, what, advice).map_err(ShapeError::Document)
    }
}
