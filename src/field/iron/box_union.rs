//! Boxes that touch or overlap, as one body: joined without a surface where their steel is one.
//!
//! The sides' planes cut space into cells, each of one box's steel or of none. Cells of different steel have a face
//! between them; those of one plane that are alike are gathered into rectangles, graded where the surface bends.

use super::bodies::{Body, SAME_M, Solid, UPRIGHT};
use super::face::{Curve, Face, Point};
use fluxform_numerics::vec3::{dot, minus, plus};

/// Rotations that differ by less are one.
const SAME_TURN: f64 = 1e-9;

/// How two boxes lie to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// No common place, or their sides are not parallel.
    None,
    /// A line or a point.
    Line,
    /// A part of a side.
    Face,
    /// A volume.
    Volume,
}

/// A box in a frame of its own: the least and the largest corner, m.
type Ends = [Point; 2];

/// The ends of `body`, a box, in the frame of `turn`; `None` where its sides are not along that.
fn ends_m(body: &Body, turn: &[Point; 3]) -> Option<Ends> {
    let Solid::Box(sides) = body.solid else {
        return None;
    };
    let column = |of: &[Point; 3], k: usize| -> Point { [of[0][k], of[1][k], of[2][k]] };
    let mut half = [0.0; 3];
    for (k, half) in half.iter_mut().enumerate() {
        for (own, side) in sides.iter().enumerate() {
            let share = dot(column(turn, k), column(&body.turn, own)).abs();
            if share > SAME_TURN && share < 1.0 - SAME_TURN {
                return None;
            }
            *half += 0.5 * side * share.round();
        }
    }
    let centre = [0, 1, 2].map(|k| dot(column(turn, k), body.centre_m));
    Some([minus(centre, half), plus(centre, half)])
}

/// How two bodies touch, if both are boxes with parallel sides.
#[must_use]
pub fn contact(a: &Body, b: &Body) -> Contact {
    let (Some(own), Some(other)) = (ends_m(a, &a.turn), ends_m(b, &a.turn)) else {
        return Contact::None;
    };
    let common = |k: usize| own[1][k].min(other[1][k]) - own[0][k].max(other[0][k]);
    let common = [0, 1, 2].map(common);
    if common.iter().any(|length| *length < -SAME_M) {
        return Contact::None;
    }
    match common.iter().filter(|length| **length > SAME_M).count() {
        3 => Contact::Volume,
        2 => Contact::Face,
        _ => Contact::Line,
    }
}

/// The lengths by which a body and its mirror image are compared: its ends, and of a tube the bore.
fn outline_m(body: &Body) -> Option<(Ends, Option<f64>)> {
    match &body.solid {
        Solid::Box(_) => ends_m(body, &UPRIGHT).map(|ends| (ends, None)),
        Solid::Tube([inner, outer, length]) if body.turn == UPRIGHT => {
            let half = [*outer, *outer, 0.5 * length];
            let (low, high) = (minus(body.centre_m, half), plus(body.centre_m, half));
            Some(([low, high], Some(*inner)))
        }
        Solid::Tube(_) | Solid::Ball(_) | Solid::Mesh(_) => None,
    }
}

/// Whether a mirror across an axis at `plane_m` leaves these groups of bodies that hang together as they are; only of
/// boxes with sides along the axes and of upright tubes.
#[must_use]
pub fn is_mirrored(groups: &[Vec<(Body, f64)>], axis: usize, plane_m: f64) -> bool {
    let within = |bodies: &[(Body, f64)]| {
        let outlines = bodies
            .iter()
            .map(|(body, chi)| Some((outline_m(body)?, *chi)));
        let Some(outlines) = outlines.collect::<Option<Vec<_>>>() else {
            return false;
        };
        outlines.iter().all(|((ends, bore), chi)| {
            let mut image = *ends;
            image[0][axis] = 2.0 * plane_m - ends[1][axis];
            image[1][axis] = 2.0 * plane_m - ends[0][axis];
            outlines.iter().any(|((other, own), of)| {
                let near = |k: usize, end: usize| (other[end][k] - image[end][k]).abs() < SAME_M;
                (own, of) == (bore, chi) && (0..3).all(|k| near(k, 0) && near(k, 1))
            })
        })
    };
    let off_plane = |group: &[(Body, f64)]| {
        let ends = group.iter().filter_map(|(body, _)| outline_m(body));
        let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (ends, _)| {
            (a.min(ends[0][axis]), b.max(ends[1][axis]))
        });
        low >= plane_m || high <= plane_m
    };
    let all: Vec<(Body, f64)> = groups.concat();
    within(&all) && groups.iter().all(|group| within(group) || off_plane(group))
}

/// The surfaces of boxes with parallel sides, each with its relative permeability less one, that hang together; boxes
/// that overlap are of one steel. No face crosses the planes x = and y = `cuts_m`, where sides are along the axes.
///
/// # Panics
/// Where a body is no box, or its sides are not parallel to the first's.
#[must_use]
pub fn joined(boxes: &[(Body, f64)], cuts_m: [Option<f64>; 2]) -> Vec<Face> {
    let upright = boxes
        .iter()
        .all(|(body, _)| ends_m(body, &UPRIGHT).is_some());
    let turn = if upright { UPRIGHT } else { boxes[0].0.turn };
    let ends: Vec<(Ends, f64)> = boxes
        .iter()
        .map(|(body, chi)| {
            (
                ends_m(body, &turn).expect("joined boxes are parallel"),
                *chi,
            )
        })
        .collect();
    let cells = Cells::new(&ends, cuts_m.map(|cut| cut.filter(|_| upright)));
    let mut faces = Vec::new();
    for axis in 0..3 {
        for plane in 0..cells.planes[axis].len() {
            cells.add_faces(axis, plane, &mut faces);
        }
    }
    let turned = |p: Point| turn.map(|row| dot(row, p));
    let moved = |face: Face| face.moved(turned, [0.0; 3]);
    faces.into_iter().map(moved).collect()
}

/// The cells into which the planes of all sides cut space.
struct Cells {
    planes: [Vec<f64>; 3],
    /// [x][y][z], x slowest.
    chi: Vec<f64>,
    /// Numbers of planes that no face crosses.
    cuts: [Option<usize>; 3],
}

impl Cells {
    fn new(boxes: &[(Ends, f64)], [x, y]: [Option<f64>; 2]) -> Self {
        let cuts_m = [x, y, None];
        let planes = [0, 1, 2].map(|axis| {
            let mut planes: Vec<f64> = boxes
                .iter()
                .flat_map(|(ends, _)| [ends[0][axis], ends[1][axis]])
                .collect();
            let ends = planes
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| {
                    (a.min(*p), b.max(*p))
                });
            planes.extend(cuts_m[axis].filter(|cut| (ends.0..ends.1).contains(cut)));
            planes.sort_by(f64::total_cmp);
            planes.dedup_by(|a, b| *a - *b < SAME_M);
            planes
        });
        let mut cells = Self {
            chi: vec![0.0; planes.iter().map(|p| p.len() - 1).product()],
            cuts: [0, 1, 2].map(|axis| {
                let at = |plane: &f64| cuts_m[axis].is_some_and(|cut| (plane - cut).abs() < SAME_M);
                planes[axis].iter().position(at)
            }),
            planes,
        };
        for k in 0..cells.chi.len() {
            let at = cells.place(k);
            let middle: Point = [0, 1, 2].map(|axis| {
                let planes = &cells.planes[axis];
                0.5 * (planes[at[axis]] + planes[at[axis] + 1])
            });
            let within =
                |ends: &Ends| (0..3).all(|k| (ends[0][k]..ends[1][k]).contains(&middle[k]));
            let of = boxes.iter().find(|(ends, _)| within(ends));
            cells.chi[k] = of.map_or(0.0, |(_, chi)| *chi);
        }
        cells
    }

    fn counts(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.planes[axis].len() - 1)
    }

    fn place(&self, k: usize) -> [usize; 3] {
        let [_, ny, nz] = self.counts();
        [k / (ny * nz), k / nz % ny, k % nz]
    }

    /// Of the cells before and after a plane, at a place in it; nothing beyond the last.
    fn sides(&self, axis: usize, plane: usize, [u, v]: [usize; 2]) -> [f64; 2] {
        let counts = self.counts();
        let of = |along: usize| {
            let mut at = [0; 3];
            at[axis] = along;
            at[(axis + 1) % 3] = u;
            at[(axis + 2) % 3] = v;
            if (0..3).any(|k| at[k] >= counts[k]) {
                return 0.0;
            }
            self.chi[(at[0] * counts[1] + at[1]) * counts[2] + at[2]]
        };
        [plane.checked_sub(1).map_or(0.0, of), of(plane)]
    }

    /// The faces in one plane.
    fn add_faces(&self, axis: usize, plane: usize, faces: &mut Vec<Face>) {
        let (across, along) = ((axis + 1) % 3, (axis + 2) % 3);
        let counts = self.counts();
        let [nu, nv] = [counts[across], counts[along]];
        let sides = |u: usize, v: usize| self.sides(axis, plane, [u, v]);
        // Beyond the first row and column there is nothing.
        let beside = |u: Option<usize>, v: Option<usize>| match (u, v) {
            (Some(u), Some(v)) => sides(u, v),
            _ => [0.0; 2],
        };
        let mut open: Vec<bool> = (0..nu * nv)
            .map(|k| {
                let [before, after] = sides(k / nv, k % nv);
                before != after
            })
            .collect();
        for first in 0..nu * nv {
            if !open[first] {
                continue;
            }
            let (u0, v0) = (first / nv, first % nv);
            let own = sides(u0, v0);
            let fits = |open: &[bool], u: usize, v: usize| open[u * nv + v] && sides(u, v) == own;
            let mut v1 = v0 + 1;
            while v1 < nv && self.cuts[along] != Some(v1) && fits(&open, u0, v1) {
                v1 += 1;
            }
            let mut u1 = u0 + 1;
            while u1 < nu && self.cuts[across] != Some(u1) && (v0..v1).all(|v| fits(&open, u1, v)) {
                u1 += 1;
            }
            for u in u0..u1 {
                open[u * nv + v0..u * nv + v1].fill(false);
            }
            let differs = |u: Option<usize>, v: Option<usize>| beside(u, v) != own;
            let edges = [
                (v0..v1).any(|v| differs(u0.checked_sub(1), Some(v))),
                (v0..v1).any(|v| differs(Some(u1), Some(v))),
                (u0..u1).any(|u| differs(Some(u), v0.checked_sub(1))),
                (u0..u1).any(|u| differs(Some(u), Some(v1))),
            ];
            let at = |u: usize, v: usize| {
                let mut at = [0.0; 3];
                at[axis] = self.planes[axis][plane];
                at[across] = self.planes[across][u];
                at[along] = self.planes[along][v];
                at
            };
            // The normal leaves steel.
            let up = own[0] != 0.0;
            let mut outside = at(u0, v0);
            outside[axis] += if up { 1.0 } else { -1.0 };
            let (a, b) = (at(u0, v0), at(u1, v0));
            let (d, c) = (at(u0, v1), at(u1, v1));
            let mut face = Face::ruled(Curve::segment(a, b), Curve::segment(d, c), edges, outside);
            face.chi = if up { own } else { [own[1], own[0]] };
            faces.push(face);
        }
    }
}
