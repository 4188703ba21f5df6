//! Conditions on the mesh of a body before it is accepted: it closes the body, looks to one side,
//! and encloses the body's exact volume with its exact area, as far as the facets' distance from the
//! faces allows. That each facet lies on its face was measured where the faces are known.

use std::collections::HashMap;

use super::longest_side;
use crate::crossings::crossings;
use crate::edges::{Edges, WELD_ROUNDINGS, weld};
use crate::file_mesh::Triangle;
use fluxform_numerics::vec3::{cross, dot, minus};

/// Vertices of neighbouring faces agree to this, against the body's size.
pub(super) const WELD: f64 = 1e-7;
/// Error of the exact volume and area: OpenCASCADE integrates numerically.
const INTEGRATED: f64 = 2e-3;
/// Bodies not much larger than the chord may lose so much of their volume and area.
const MOST_APART: f64 = 0.15;
/// Reaches, against the deviation, that are tried to close narrow gaps.
const GAPS: [f64; 4] = [1e-3, 1e-2, 0.1, 1.0];
/// Longest open loop that is filled; the search for the least fill takes the third power of it.
const MOST_CORNERS: usize = 128;

/// One body's mesh and exact figures, mm.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Part {
    /// Counterclockwise from outside.
    pub(super) triangles: Vec<Triangle>,
    /// The most that a facet or a side lies from its face or edge.
    pub(super) deviation: f64,
    /// Exact area.
    pub(super) area: f64,
    /// Exact volume.
    pub(super) volume: f64,
    /// Read again in another way, since the first one gave an invalid body.
    pub(super) mended: bool,
}

/// Closes a body whose faces do not quite meet. An edge where the body touches itself has four
/// triangles; it is closed where as many run one way as the other.
fn close(part: &mut Part, reach: f64) -> Result<(), String> {
    let edges = Edges::new(&weld(&part.triangles, reach));
    if edges.unbalanced.is_empty() {
        return Ok(());
    }
    // Between two ways to cut one edge lie slits: what fills them leaves the faces by their width.
    let mut filled = part.triangles.clone();
    filled.extend(slits(&part.triangles, reach, part.deviation));
    if Edges::new(&weld(&filled, reach)).unbalanced.is_empty() {
        part.triangles = filled;
        return Ok(());
    }
    // Where vertices differ, the first of those within the deviation stands for all of them.
    for share in GAPS {
        let reach = (share * part.deviation).max(reach);
        let names = weld(&part.triangles, reach);
        if Edges::new(&names).unbalanced.is_empty() {
            let moved = join(&mut part.triangles, &names);
            part.deviation += moved;
            return Ok(());
        }
    }
    if edges.closed() {
        return Err("its facets do not look to one side".into());
    }
    Err(format!(
        "its surface is not closed ({} open edges)",
        edges.unbalanced.len()
    ))
}

/// Triangles that fill the open loops no wider than `width`: those whose least spanning area is at
/// most their half perimeter times that.
fn slits(triangles: &[Triangle], reach: f64, width: f64) -> Vec<Triangle> {
    let names = weld(triangles, reach);
    let mut at: HashMap<u32, [f64; 3]> = HashMap::new();
    for (triangle, names) in triangles.iter().zip(&names) {
        for (vertex, name) in triangle.iter().zip(names) {
            at.entry(*name).or_insert(*vertex);
        }
    }
    // The edge that closes another one runs in the opposite direction.
    let mut next: HashMap<u32, u32> = HashMap::new();
    for ([from, to], times) in Edges::new(&names).unbalanced {
        if times > 1 || next.insert(to, from).is_some() {
            return Vec::new();
        }
    }
    let mut made = Vec::new();
    let mut starts: Vec<u32> = next.keys().copied().collect();
    starts.sort_unstable();
    for start in starts {
        let mut corners = Vec::new();
        let mut here = start;
        while let Some(there) = next.remove(&here) {
            corners.push(at[&here]);
            here = there;
        }
        if !(3..=MOST_CORNERS).contains(&corners.len()) || here != start {
            continue;
        }
        let sides = (0..corners.len()).map(|k| {
            let along = minus(corners[(k + 1) % corners.len()], corners[k]);
            dot(along, along).sqrt()
        });
        let most = 0.5 * width * sides.sum::<f64>();
        let (area, fill) = least_fill(&corners);
        if area <= most {
            made.extend(fill);
        }
    }
    made
}

/// The triangles over a loop whose areas are least together, and their area.
fn least_fill(corners: &[[f64; 3]]) -> (f64, Vec<Triangle>) {
    let count = corners.len();
    let triangle = |i: usize, j: usize, k: usize| [corners[i], corners[j], corners[k]];
    // Of the part from i to k: the least area, and the corner between them that gives it.
    let mut best = vec![(0.0, 0); count * count];
    for span in 2..count {
        for i in 0..count - span {
            let k = i + span;
            let area = |j: usize| {
                best[i * count + j].0 + best[j * count + k].0 + area_of(&triangle(i, j, k))
            };
            let tried = (i + 1..k).map(|j| (area(j), j));
            best[i * count + k] = tried.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0));
        }
    }
    let mut made = Vec::new();
    let mut open = vec![(0, count - 1)];
    while let Some((i, k)) = open.pop() {
        if k > i + 1 {
            let j = best[i * count + k].1;
            made.push(triangle(i, j, k));
            open.extend([(i, j), (j, k)]);
        }
    }
    (best[count - 1].0, made)
}

fn area_of([a, b, c]: &Triangle) -> f64 {
    let normal = cross(minus(*b, *a), minus(*c, *a));
    0.5 * dot(normal, normal).sqrt()
}

/// Puts corners of one name where the first of them is; the farthest that one moved.
fn join(triangles: &mut [Triangle], names: &[[u32; 3]]) -> f64 {
    let mut at: HashMap<u32, [f64; 3]> = HashMap::new();
    let mut moved = 0.0f64;
    for (triangle, names) in triangles.iter_mut().zip(names) {
        for (vertex, name) in triangle.iter_mut().zip(names) {
            let there = *at.entry(*name).or_insert(*vertex);
            let apart = minus(there, *vertex);
            moved = moved.max(dot(apart, apart).sqrt());
            *vertex = there;
        }
    }
    moved
}

/// Properties of a mesh that passed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Verdict {
    /// Pairs of facets that pass through each other.
    pub(super) crossings: usize,
}

/// Why a body's mesh is not believed; what else is known of it if it is. Gaps no wider than the
/// deviation are closed.
pub(super) fn check(part: &mut Part) -> Result<Verdict, String> {
    let size = longest_side(&part.triangles);
    if !(size > 0.0 && size.is_finite()) {
        return Err("it has no extent".into());
    }
    let reach = WELD_ROUNDINGS * 0.5 * WELD * size;
    close(part, reach)?;
    let names = weld(&part.triangles, reach);
    let origin = part.triangles[0][0];
    let (mut area, mut volume) = (0.0, 0.0);
    for triangle in &part.triangles {
        let [a, b, c] = triangle.map(|v| minus(v, origin));
        let normal = cross(minus(b, a), minus(c, a));
        area += area_of(triangle);
        volume += dot(a, normal) / 6.0;
    }
    let bow = part.deviation * part.area;
    let apart = (volume - part.volume).abs();
    if apart > (bow + INTEGRATED * part.volume).min(MOST_APART * part.volume) {
        return Err(format!(
            "its mesh encloses {volume:.6} mm^3, the body {:.6} mm^3",
            part.volume
        ));
    }
    if (area - part.area).abs() > MOST_APART * part.area {
        return Err(format!(
            "its mesh covers {area:.6} mm^2, the body {:.6} mm^2",
            part.area
        ));
    }
    // Within the deviation crossings may be of the mesh alone, and the two sides of a thin wall seem one.
    let pairs = |reach| crossings(&part.triangles, &names, reach).pairs;
    let crossings = match pairs(part.deviation.max(reach)) {
        0 => 0,
        wide => wide.min(pairs(reach)),
    };
    // A hole taken for more of its face gives a closed mesh that lies over itself.
    if part.mended && crossings > 0 {
        return Err(format!(
            "OpenCASCADE cannot tell the holes of its faces from the faces ({crossings} pairs of facets \
             pass through each other)"
        ));
    }
    Ok(Verdict { crossings })
}

#[cfg(test)]
mod tests {
    use fluxform_testing::boxes;

    use super::*;

    /// A block of these sides with a corner at `low`, counterclockwise from outside.
    fn block(low: [f64; 3], sides: [f64; 3]) -> Vec<Triangle> {
        boxes::block(low, std::array::from_fn(|k| low[k] + sides[k]))
    }

    fn part(triangles: Vec<Triangle>, area: f64, volume: f64) -> Part {
        Part {
            triangles,
            deviation: 0.01,
            area,
            volume,
            mended: false,
        }
    }

    /// A ball with a hole through it was read as the ball with the plug of the hole added.
    #[test]
    fn a_body_that_was_read_again_may_not_lie_over_itself() {
        let mut triangles = block([0.0; 3], [0.7, 1.3, 0.9]);
        triangles.extend(block([0.2, 0.3, 0.1], [0.3, 0.4, 1.7]));
        let area = 2.0 * (0.7 * 1.3 + 0.7 * 0.9 + 1.3 * 0.9 + 0.3 * 0.4 + 0.3 * 1.7 + 0.4 * 1.7);
        let mut twice = part(triangles, area, 0.819 + 0.204);
        assert!(check(&mut twice).unwrap().crossings > 0);
        twice.mended = true;
        let why = check(&mut twice).unwrap_err();
        assert!(why.contains("holes of its faces"), "{why}");
    }

    /// Facets at the tip of a cone, less than the deviation apart, were said to pass through each other.
    #[test]
    fn a_wall_thinner_than_the_deviation_does_not_cross_itself() {
        let plate = block([0.0; 3], [0.7, 1.3, 0.006]);
        let area = 2.0 * (0.7 * 1.3 + 0.7 * 0.006 + 1.3 * 0.006);
        let mut thin = part(plate, area, 0.7 * 1.3 * 0.006);
        assert_eq!(check(&mut thin).unwrap().crossings, 0);
    }

    #[test]
    fn a_body_that_touches_itself_along_an_edge_is_closed() {
        let mut triangles = block([0.0; 3], [0.7, 1.3, 0.9]);
        triangles.extend(block([0.7, 1.3, 0.0], [1.1, 0.4, 0.9]));
        let area = 2.0 * (0.7 * 1.3 + 0.7 * 0.9 + 1.3 * 0.9 + 1.1 * 0.4 + 1.1 * 0.9 + 0.4 * 0.9);
        let volume = 0.9 * (0.7 * 1.3 + 1.1 * 0.4);
        assert!(check(&mut part(triangles.clone(), area, volume)).is_ok());
        triangles.pop();
        let why = check(&mut part(triangles, area, volume)).unwrap_err();
        assert!(why.contains("not closed"), "{why}");
    }

    /// The upper face's two triangles are cut along one side at a place that its neighbour lacks,
    /// `off` beside it.
    fn with_slit(off: f64) -> Part {
        let mut triangles = block([0.0; 3], [0.7, 1.3, 0.9]);
        let [from, to] = [[0.0, 0.0, 0.9], [0.7, 0.0, 0.9]];
        let at = triangles
            .iter()
            .position(|t| t.contains(&from) && t.contains(&to) && t.iter().all(|v| v[2] == 0.9));
        let cut = triangles.remove(at.unwrap());
        let middle = [0.31, off, 0.9];
        for k in 0..3 {
            let [a, b, c] = [cut[k], cut[(k + 1) % 3], cut[(k + 2) % 3]];
            if a == from && b == to {
                triangles.extend([[a, middle, c], [middle, b, c]]);
            }
        }
        part(triangles, 5.42, 0.819)
    }

    #[test]
    fn a_slit_narrower_than_the_deviation_is_filled_and_a_hole_is_not() {
        let mut narrow = with_slit(0.004);
        let before = narrow.triangles.len();
        check(&mut narrow).unwrap();
        assert_eq!(narrow.triangles.len(), before + 1);
        let names = weld(&narrow.triangles, 1e-9);
        assert!(Edges::new(&names).closed());
        assert_eq!(Edges::new(&names).inconsistent, 0);
        let why = check(&mut with_slit(0.2)).unwrap_err();
        assert!(why.contains("not closed"), "{why}");
    }

    #[test]
    fn faces_that_end_beside_each_other_are_joined() {
        let mut triangles = block([0.0; 3], [0.7, 1.3, 0.9]);
        for vertex in triangles[2..4].as_flattened_mut() {
            vertex[2] += 0.003;
        }
        let mut apart = part(triangles, 5.42, 0.819);
        check(&mut apart).unwrap();
        assert!(Edges::new(&weld(&apart.triangles, 1e-9)).closed());
        assert!(
            (apart.deviation - 0.013).abs() < 1e-9,
            "{}",
            apart.deviation
        );
    }
}
