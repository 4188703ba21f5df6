//! A cell that is quartered where its corners describe the surface badly, and the samples of its parts.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::{Over, along, covered_part};
use crate::deviation::{Faces, Lattice, Patch, Rect, Standing};
use crate::height::Grid;
use fluxform_numerics::axis::Axis;

/// A part of a cell is smooth whose middle departs by less than this share of its height from its corners' mean,
/// over its share of the cell: what a part adds to lambda's error is its departure times
/// its area.
const SMOOTH_PART: f64 = 5e-4;
/// So many times at most: departures of a texture have one sign in many parts.
const MOST_WIDENED: f64 = 16.0;
/// The share of a part at most that lies between a quarter and three quarters of its height where it jumps.
const SLOPING: f64 = 0.25;
/// Bisections of a side of a part: to 4e-3 of it.
const PART_BISECTIONS: u32 = 8;

/// Samples of a cell: the part that each stands for, and its areas in both rules, m^2.
pub(super) type CellSamples = Vec<(Part, [f64; 2])>;

/// Samples a cell in the middle of quarters, which are quartered again where the surface ends or departs
/// from their corners; none where none has surface. Also how many triangles its looks met.
pub(super) fn cell_samples(
    grid: &Grid,
    cell: usize,
    depth: u32,
    surface: Over,
) -> (CellSamples, usize) {
    let across = grid.x_m.samples - 1;
    let part = |axis: Axis, node: usize| Axis {
        from: axis.node(node),
        to: axis.node(node + 1),
        samples: (1 << depth) + 1,
    };
    let lattice = surface.lattice;
    let members = lattice.map_or_else(Cow::default, |lattice| lattice.members(cell));
    let mut quarters = Quarters {
        faces: lattice.map(Lattice::faces),
        whole: depth,
        x_m: part(grid.x_m, cell % across),
        y_m: part(grid.y_m, cell / across),
        surface,
        met: 0,
        heights_m: BTreeMap::new(),
        ends: BTreeMap::new(),
        fine: Vec::new(),
        coarse: Vec::new(),
    };
    quarters.divide(depth, [0, 0], &members);
    let Quarters {
        fine, coarse, met, ..
    } = quarters;
    let area = |rule: &[Part]| rule.iter().map(|part| part.area_m2).sum::<f64>();
    let total = area(&fine);
    if total == 0.0 {
        return (Vec::new(), met);
    }
    let coarse = if coarse.is_empty() {
        fine.clone()
    } else {
        coarse
    };
    let scale = total / area(&coarse);
    // A part that both rules share is one sample.
    let of_coarse = |part: &Part| match coarse.contains(part) {
        true => scale * part.area_m2,
        false => 0.0,
    };
    let rules = fine
        .iter()
        .map(|part| (*part, [part.area_m2, of_coarse(part)]));
    let coarse_alone = coarse.iter().filter(|part| !fine.contains(part));
    let coarse_alone = coarse_alone.map(|part| (*part, [0.0, scale * part.area_m2]));
    (rules.chain(coarse_alone).collect(), met)
}

/// A node of the finest division of a cell, along x and y.
type Node = [usize; 2];

/// A part of a cell, and the sample that stands for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Part {
    pub(super) at_m: [f64; 2],
    pub(super) height_m: f64,
    pub(super) area_m2: f64,
}

impl Part {
    pub(super) fn of(standing: Standing, height_m: f64) -> Self {
        let Standing { at_m, area_m2 } = standing;
        Self {
            at_m,
            height_m,
            area_m2,
        }
    }
}

/// Whether a part is not quartered, and the samples that it then has.
#[derive(Debug, Clone)]
enum Leaf {
    Is(Vec<Part>),
    IsNot,
}

/// A part that is looked at.
struct Square {
    /// Its corners, one after the other around it.
    nodes: [Node; 4],
    heights_m: [Option<f64>; 4],
    rect: Rect,
    /// The faces over it.
    members: Vec<u32>,
    /// A part is smooth whose surface departs from its corners by no more than this share of their height.
    smooth: f64,
}

impl Square {
    /// The mean height of its corners, which all have one, m.
    fn mean_m(&self) -> f64 {
        0.25 * self.heights_m.iter().flatten().sum::<f64>()
    }

    /// By how much a smooth part departs from its corners, at most, m.
    fn smooth_m(&self) -> f64 {
        self.smooth * self.mean_m()
    }

    /// What lies between its corners, if all have a height.
    fn patch(&self) -> Option<Patch> {
        let [a, b, c, d] = self.heights_m;
        Some(Patch {
            rect: self.rect,
            corners_m: [a?, b?, d?, c?],
        })
    }
}

/// A cell that is quartered where its corners describe the surface badly.
struct Quarters<'a> {
    /// A mesh's faces.
    faces: Option<&'a Faces>,
    /// How often it is quartered at most.
    whole: u32,
    /// The nodes of the finest division.
    x_m: Axis,
    y_m: Axis,
    surface: Over<'a>,
    /// Triangles that its looks met.
    met: usize,
    heights_m: BTreeMap<Node, Option<f64>>,
    /// How far the surface goes from a node to the next of a part: two parts have that side.
    ends: BTreeMap<[Node; 2], f64>,
    /// Parts that are not quartered again.
    fine: Vec<Part>,
    /// The same without the last quartering of each.
    coarse: Vec<Part>,
}

impl Quarters<'_> {
    fn place(&self, node: Node) -> [f64; 2] {
        [self.x_m.node(node[0]), self.y_m.node(node[1])]
    }

    fn height_m(&mut self, node: Node) -> Option<f64> {
        if let Some(known) = self.heights_m.get(&node) {
            return *known;
        }
        let height_m = self.look(self.place(node));
        self.heights_m.insert(node, height_m);
        height_m
    }

    fn look(&mut self, place: [f64; 2]) -> Option<f64> {
        self.met += (self.surface.near)(place);
        (self.surface.height_m)(place)
    }

    /// Divides the part from the node `first` on, which is quartered `depth` times at most and lies under faces
    /// that are all among `around`. Returns what stands for it where it is not quartered.
    fn divide(&mut self, depth: u32, first: Node, around: &[u32]) -> Leaf {
        fluxform_base::progress::poll();
        let side = 1 << depth;
        let nodes = AROUND.map(|by| [first[0] + side * by[0], first[1] + side * by[1]]);
        let rect = Rect {
            low_m: self.place(nodes[0]),
            high_m: self.place(nodes[2]),
        };
        self.met += around.len();
        let square = Square {
            nodes,
            heights_m: nodes.map(|corner| self.height_m(corner)),
            rect,
            members: (self.faces).map_or_else(Vec::new, |faces| faces.over(&rect, around)),
            smooth: SMOOTH_PART * f64::from(1_u32 << (2 * (self.whole - depth))).min(MOST_WIDENED),
        };
        let smooth = match square.heights_m.iter().flatten().count() {
            _ if depth == 0 => true,
            0 => square.members.is_empty(),
            4 => {
                let (mean, middle) = (square.mean_m(), first.map(|at| at + side / 2));
                let middle = self.height_m(middle);
                middle.is_some_and(|height| ((height - mean) / mean).abs() <= square.smooth)
                    && !self.breaks(&square)
            }
            _ => false,
        };
        // The whole cell is divided: that is why it is here.
        if smooth && depth < self.whole {
            let parts = self.parts(&square);
            self.fine.extend(&parts);
            return Leaf::Is(parts);
        }
        let half = side / 2;
        let quarters = AROUND.map(|by| {
            let first = [first[0] + half * by[0], first[1] + half * by[1]];
            self.divide(depth - 1, first, &square.members)
        });
        if quarters
            .iter()
            .all(|quarter| matches!(quarter, Leaf::Is(_)))
        {
            let parts = self.parts(&square);
            self.coarse.extend(parts);
        } else {
            let leaves = quarters.into_iter().filter_map(|quarter| match quarter {
                Leaf::Is(parts) => Some(parts),
                Leaf::IsNot => None,
            });
            self.coarse.extend(leaves.flatten());
        }
        Leaf::IsNot
    }

    /// Whether the surface rises or falls between the corners of a part of four, more than smooth ones do.
    fn breaks(&self, square: &Square) -> bool {
        let (by_m, members) = (square.smooth_m(), &square.members);
        self.faces
            .zip(square.patch())
            .is_some_and(|(faces, patch)| {
                faces.rises(&patch, members, by_m) || faces.fallen_m2(&patch, members, by_m) > 0.0
            })
    }

    /// The two levels of a part of four over which the surface jumps; `None` where it bends or slopes, which its middle
    /// knows.
    fn levels(&mut self, square: &Square) -> Option<[Part; 2]> {
        let (faces, patch) = (self.faces?, square.patch()?);
        let by_m = SMOOTH_PART * square.mean_m();
        let rises = faces.rises(&patch, &square.members, by_m);
        if !rises && faces.fallen_m2(&patch, &square.members, by_m) <= 0.0 {
            return None;
        }
        let middle = square.rect.centre();
        let middle = self.look(middle).map(|height_m| (middle, height_m));
        let over = (&patch, &square.members[..]);
        let fallen = faces.fallen_to(over, by_m, |place| self.look(place));
        let corners = square.nodes.into_iter().zip(square.heights_m);
        let corners = corners.filter_map(|(node, height_m)| Some((self.place(node), height_m?)));
        let seen = middle.into_iter().chain(fallen).chain(corners);
        let (low_at, low_m) = seen.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let high_m = faces.highest_m(&square.rect, &square.members)?;
        let level_m = |part: f64| low_m + part * (high_m - low_m);
        let above_m2 = |part| faces.above_m2(&square.rect, &square.members, level_m(part));
        let [width, depth] = square.rect.sides();
        if high_m - low_m <= by_m || above_m2(0.25) - above_m2(0.75) > SLOPING * width * depth {
            return None;
        }
        let half = faces.above(&square.rect, &square.members, level_m(0.5))?;
        let high = Part::of(half, self.look(half.at_m)?);
        let (at_m, height_m) = middle
            .filter(|at| at.1 < level_m(0.5))
            .unwrap_or((low_at, low_m));
        let low = Part {
            at_m,
            height_m,
            area_m2: width * depth - high.area_m2,
        };
        Some([low, high])
    }

    /// What stands for a part: its piece that has surface, or both levels where that jumps; what lies between corners that
    /// have no surface.
    fn parts(&mut self, square: &Square) -> Vec<Part> {
        if square.heights_m.iter().all(Option::is_none) {
            let faces = self.faces;
            let standing = faces.and_then(|faces| faces.standing(&square.rect, &square.members));
            let part = standing.and_then(|standing| {
                let height_m = self.look(standing.at_m)?;
                Some(Part::of(standing, height_m))
            });
            return part.into_iter().collect();
        }
        let parts = match self.levels(square) {
            Some(levels) => levels.to_vec(),
            None => (self.part(square.nodes, square.heights_m).into_iter()).collect(),
        };
        (parts.into_iter())
            .filter(|part| part.area_m2 > 0.0)
            .collect()
    }

    /// The piece of a part that has surface, with its middle; `None` without any.
    fn part(&mut self, nodes: [Node; 4], heights_m: [Option<f64>; 4]) -> Option<Part> {
        let corners = nodes.map(|node| self.place(node));
        let mut outline = Vec::with_capacity(8);
        for k in 0..4 {
            let next = (k + 1) % 4;
            let present = [heights_m[k].is_some(), heights_m[next].is_some()];
            if present[0] {
                outline.push(corners[k]);
            }
            if present[0] != present[1] {
                let [has, lacks] = if present[0] { [k, next] } else { [next, k] };
                let (from, to) = (corners[has], corners[lacks]);
                let Over { covers, near, .. } = self.surface;
                let end = self.ends.entry([nodes[has], nodes[lacks]]);
                let part = end.or_insert_with(|| {
                    self.met += PART_BISECTIONS as usize * near(from);
                    covered_part(from, to, covers, PART_BISECTIONS)
                });
                outline.push(along(from, to, *part));
            }
        }
        let (area_m2, middle) = area_and_middle(&outline)?;
        let at_corner = || {
            let mut present = corners.into_iter().zip(heights_m);
            present.find_map(|(corner, height_m)| Some((corner, height_m?)))
        };
        // A bay of the silhouette may hold the middle.
        let found = self.look(middle).map(|height_m| (middle, height_m));
        let (at_m, height_m) = found.or_else(at_corner)?;
        Some(Part {
            at_m,
            height_m,
            area_m2,
        })
    }
}

/// The corners of a cell, one after the other around it.
const AROUND: [Node; 4] = [[0, 0], [1, 0], [1, 1], [0, 1]];

/// Area and centre of mass of an outline; `None` without area.
fn area_and_middle(outline: &[[f64; 2]]) -> Option<(f64, [f64; 2])> {
    let first = outline.first()?;
    let (mut twice, mut moment) = (0.0, [0.0; 2]);
    for pair in outline.windows(2) {
        let [a, b] = [pair[0], pair[1]].map(|p| [p[0] - first[0], p[1] - first[1]]);
        let cross = a[0] * b[1] - a[1] * b[0];
        twice += cross;
        for k in 0..2 {
            moment[k] += cross * (a[k] + b[k]) / 3.0;
        }
    }
    (twice > 0.0).then(|| {
        let middle = [0, 1].map(|k| first[k] + moment[k] / twice);
        (0.5 * twice, middle)
    })
}
