//! Closed bodies from a surface file, their facets looking outwards; or where the surface is none of a body.
//!
//! The file's own orientation is not relied on: facets that meet are turned alike, and a part inside an odd number of
//! others is a cavity. Facets that lie twice are one; two that look at each other are a wall inside a body and go.

use std::collections::HashMap;
use std::path::Path;

use crate::crossings::crossings;
use crate::document::Placement;
use crate::edges::{WELD_ROUNDINGS, weld};
use crate::error::ShapeError;
use crate::file_mesh::{FileMesh, Triangle};
use crate::format::SurfaceFormat;
use crate::placement::Transform;
use crate::surface::unit_of;
use fluxform_numerics::solid_angle::turns_about;
use fluxform_numerics::vec3::{cross, dot, minus, norm};

/// Coordinates beyond this are no lengths of a display, m.
const FARTHEST_M: f64 = 1e3;

/// Bodies, each of one piece.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosedBodies {
    /// Corners of facets, m.
    pub vertices_m: Vec<[f64; 3]>,
    /// Of every body its facets, anticlockwise as seen from outside, those of its cavities among them.
    pub bodies: Vec<Vec<[u32; 3]>>,
    /// Repairs, as warnings.
    pub warnings: Vec<String>,
}

/// How a file's bytes are read and placed.
#[derive(Debug, Clone, Copy)]
pub struct BodyRequest<'a> {
    /// Names the file in messages; its ending states the format.
    pub path: &'a Path,
    /// Metres of the coordinates' unit, where it is stated beside the file.
    pub unit_m: Option<f64>,
    /// Rotation about x, then y, then z, degrees.
    pub rotate_deg: [f64; 3],
    /// Then the translation, m.
    pub translate_m: [f64; 3],
    /// More facets are refused before anything is done with them.
    pub most_facets: usize,
}

impl ClosedBodies {
    /// The bodies in the file's `bytes`.
    ///
    /// # Errors
    /// [`ShapeError`]: a file that cannot be read, a surface that is open, crosses itself or is one-sided, each with
    /// its place.
    pub fn read(bytes: &[u8], request: &BodyRequest<'_>) -> Result<Self, ShapeError> {
        let path = request.path;
        let format = SurfaceFormat::of(path).or_else(|| SurfaceFormat::of_content(bytes));
        let format = format.ok_or_else(|| ShapeError::Format { path: path.into() })?;
        let file = format.read(path, bytes)?;
        let unit_m = unit_of(path, format, file.unit_m, request.unit_m)?;
        if file.triangles.len() > request.most_facets {
            return Err(ShapeError::Document(format!(
                "{}: {} facets, at most {} are solved; export the body coarser, or leave out holes and fillets that \
                 the flux does not pass",
                path.display(),
                file.triangles.len(),
                request.most_facets
            )));
        }
        let placement = Placement {
            rotate_deg: request.rotate_deg,
            translate_m: request.translate_m,
            ..Placement::default()
        };
        Soup::new(file, &Transform::new(unit_m, &placement))
            .and_then(Soup::close)
            .map_err(|fault| match fault {
                ShapeError::Document(what) => {
                    ShapeError::Document(format!("{}: {what}", path.display()))
                }
                other => other,
            })
    }
}

/// Placed triangles and which corners are one.
struct Soup {
    vertices_m: Vec<[f64; 3]>,
    facets: Vec<[u32; 3]>,
    rounding_m: f64,
    warnings: Vec<String>,
}

/// An edge from its lower to its higher vertex, the facet that has it, and whether it runs upwards there.
type Side = ([u32; 2], usize, bool);

impl Soup {
    fn new(file: FileMesh, transform: &Transform) -> Result<Self, ShapeError> {
        let names = weld(&file.triangles, WELD_ROUNDINGS * file.coordinate_rounding);
        let count = names.as_flattened().iter().max().map_or(0, |most| most + 1);
        let mut vertices_m = vec![[f64::NAN; 3]; count as usize];
        let corners = file.triangles.as_flattened().iter();
        for (number, (name, corner)) in names.as_flattened().iter().zip(corners).enumerate() {
            let place = &mut vertices_m[*name as usize];
            if place[0].is_nan() {
                *place = transform.apply(*corner);
            }
            if let Some(far) = place
                .iter()
                .find(|c| !(-FARTHEST_M..=FARTHEST_M).contains(*c))
            {
                return Err(ShapeError::TooFar {
                    triangle: number / 3 + 1,
                    coordinate_m: *far,
                    limit_m: FARTHEST_M,
                });
            }
        }
        let mut soup = Self {
            vertices_m,
            facets: names,
            rounding_m: transform.length_m(file.coordinate_rounding),
            warnings: file.warnings,
        };
        let read = soup.facets.len();
        soup.facets.retain(|[a, b, c]| a != b && b != c && c != a);
        soup.warn(read - soup.facets.len(), "facets without area are left out");
        soup.unite_doubled()?;
        Ok(soup)
    }

    fn warn(&mut self, count: usize, what: &str) {
        if count > 0 {
            self.warnings.push(format!("{count} {what}"));
        }
    }

    /// Facets with the same corners: one of those that look the same way, none of two that look at each other.
    fn unite_doubled(&mut self) -> Result<(), ShapeError> {
        let mut looks: HashMap<[u32; 3], i64> = HashMap::new();
        for facet in &self.facets {
            let (key, up) = sorted(*facet);
            *looks.entry(key).or_default() += if up { 1 } else { -1 };
        }
        let before = self.facets.len();
        self.facets.retain(|facet| {
            let (key, up) = sorted(*facet);
            let look = looks.get_mut(&key);
            let kept = look
                .as_ref()
                .is_some_and(|sum| if up { **sum > 0 } else { **sum < 0 });
            if let Some(sum) = look.filter(|_| kept) {
                *sum = 0;
            }
            kept
        });
        if self.facets.is_empty() {
            let what = if before == 0 {
                "holds no facet with an area; export the body again"
            } else {
                "every facet is there twice, looking to both sides: a sheet without thickness; export a solid body"
            };
            return Err(ShapeError::Document(what.to_owned()));
        }
        let doubled = before - self.facets.len();
        self.warn(doubled, "facets that lie on others are left out");
        Ok(())
    }

    fn close(mut self) -> Result<ClosedBodies, ShapeError> {
        let neighbours = self.neighbours()?;
        let parts = self.turn_alike(&neighbours)?;
        let reach = WELD_ROUNDINGS * self.rounding_m;
        let triangles: Vec<Triangle> = (0..self.facets.len()).map(|k| self.corners(k)).collect();
        let found = crossings(&triangles, &self.facets, reach);
        if let Some(pair) = found.first {
            let [a, b] = pair.map(|k| triangles[k]);
            let middle = |t: Triangle| [0, 1, 2].map(|k| (t[0][k] + t[1][k] + t[2][k]) / 3.0);
            let smaller = if area(a) < area(b) { a } else { b };
            return Err(ShapeError::Document(format!(
                "{} pairs of facets pass through each other or overlap, the first at {}: unite the parts of the body \
                 in the CAD program, and export one solid",
                found.pairs,
                place_mm(middle(smaller))
            )));
        }
        if !found.complete {
            let what = "too many facets lie over each other for their crossings to be looked for; export one solid";
            return Err(ShapeError::Document(what.to_owned()));
        }
        self.nest(parts)
    }

    fn corners(&self, facet: usize) -> Triangle {
        self.facets[facet].map(|k| self.vertices_m[k as usize])
    }

    /// The facets at the edges of every one, with whether both run along the edge the same way.
    fn neighbours(&self) -> Result<Vec<Vec<(usize, bool)>>, ShapeError> {
        let mut sides: Vec<Side> = Vec::with_capacity(3 * self.facets.len());
        for (number, facet) in self.facets.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (facet[k], facet[(k + 1) % 3]);
                sides.push(([a.min(b), a.max(b)], number, a < b));
            }
        }
        sides.sort_unstable();
        let mut out = vec![Vec::new(); self.facets.len()];
        let (mut open, mut crowded) = (Vec::new(), Vec::new());
        for group in sides.chunk_by(|a, b| a.0 == b.0) {
            match group {
                [(_, f, up), (_, g, other)] => {
                    out[*f].push((*g, up == other));
                    out[*g].push((*f, up == other));
                }
                [(edge, ..)] => open.push(*edge),
                [(edge, ..), ..] => crowded.push(*edge),
                [] => {}
            }
        }
        let edge = |[a, b]: [u32; 2]| {
            let [a, b] = [a, b].map(|k| place_mm(self.vertices_m[k as usize]));
            format!("from {a} to {b}")
        };
        let fault = match (open.first(), crowded.first()) {
            (Some(first), _) => format!(
                "the mesh is open: {} edges have one facet, the first {}; close it in the CAD program, or export a \
                 solid body",
                open.len(),
                edge(*first)
            ),
            (None, Some(first)) => format!(
                "{} edges have more than two facets, the first {}: parts touch along a line; move them apart or \
                 unite them, and export one solid",
                crowded.len(),
                edge(*first)
            ),
            (None, None) => return Ok(out),
        };
        Err(ShapeError::Document(fault))
    }

    /// Turns facets so that those that meet look to the same side; the parts that hang together.
    fn turn_alike(
        &mut self,
        neighbours: &[Vec<(usize, bool)>],
    ) -> Result<Vec<Vec<usize>>, ShapeError> {
        let mut turned: Vec<Option<bool>> = vec![None; self.facets.len()];
        let (mut parts, mut against) = (Vec::new(), 0);
        for start in 0..self.facets.len() {
            if turned[start].is_some() {
                continue;
            }
            turned[start] = Some(false);
            let (mut part, mut next) = (vec![start], 0);
            while let Some(facet) = part.get(next).copied() {
                next += 1;
                let own = turned[facet] == Some(true);
                for (other, same_way) in &neighbours[facet] {
                    let requested = own != *same_way;
                    match turned[*other] {
                        None => {
                            turned[*other] = Some(requested);
                            part.push(*other);
                        }
                        Some(is) if is != requested => {
                            let at = place_mm(self.corners(*other)[0]);
                            return Err(ShapeError::Document(format!(
                                "the mesh has one side only, as a Moebius strip, seen at {at}: it bounds no body"
                            )));
                        }
                        Some(_) => {}
                    }
                }
            }
            let flips = part.iter().filter(|k| turned[**k] == Some(true)).count();
            against += flips.min(part.len() - flips);
            parts.push(part);
        }
        for (facet, turned) in self.facets.iter_mut().zip(turned) {
            if turned == Some(true) {
                facet.swap(1, 2);
            }
        }
        self.warn(
            against,
            "facets looked the other way than those about them and are turned",
        );
        Ok(parts)
    }

    /// Turns whole parts outwards, cavities inwards, and gathers them by bodies.
    fn nest(mut self, parts: Vec<Vec<usize>>) -> Result<ClosedBodies, ShapeError> {
        let place = |part: &Vec<usize>| self.corners(part[0])[0];
        let inside = |of: &Vec<usize>, at: [f64; 3]| {
            turns_about(of.iter().map(|k| self.corners(*k)), at).abs() > 0.5
        };
        let around: Vec<Vec<usize>> = parts
            .iter()
            .enumerate()
            .map(|(number, part)| {
                let others = (0..parts.len()).filter(|other| *other != number);
                others
                    .filter(|other| inside(&parts[*other], place(part)))
                    .collect()
            })
            .collect();
        let mut turned = 0;
        for (part, around) in parts.iter().zip(&around) {
            let volume = self.volume_m3(part);
            if volume == 0.0 {
                let at = place_mm(self.corners(part[0])[0]);
                let what = format!("the part at {at} holds no volume; export a solid body");
                return Err(ShapeError::Document(what));
            }
            if (volume > 0.0) != (around.len() % 2 == 0) {
                turned += part.len();
                for facet in part {
                    self.facets[*facet].swap(1, 2);
                }
            }
        }
        self.warn(
            turned,
            "facets looked into the body and are turned outwards",
        );
        let (mut bodies, mut body_of) = (Vec::new(), vec![None; parts.len()]);
        for (number, around) in around.iter().enumerate() {
            if around.len() % 2 == 0 {
                body_of[number] = Some(bodies.len());
                bodies.push(Vec::new());
            }
        }
        for (number, part) in parts.iter().enumerate() {
            // A cavity's body is the innermost part about it.
            let outer = around[number]
                .iter()
                .max_by_key(|other| around[**other].len());
            let own = body_of[number].or(outer.and_then(|outer| body_of[*outer]));
            if let Some(own) = own {
                let facets: &mut Vec<[u32; 3]> = &mut bodies[own];
                facets.extend(part.iter().map(|k| self.facets[*k]));
            }
        }
        Ok(ClosedBodies {
            vertices_m: self.vertices_m,
            bodies,
            warnings: self.warnings,
        })
    }

    fn volume_m3(&self, part: &[usize]) -> f64 {
        let from = self.corners(part[0])[0];
        let of = |facet: &usize| {
            let [a, b, c] = self.corners(*facet).map(|corner| minus(corner, from));
            dot(a, cross(b, c)) / 6.0
        };
        part.iter().map(of).sum()
    }
}

/// Corners in ascending order, and whether they turn as the facet's.
fn sorted(facet: [u32; 3]) -> ([u32; 3], bool) {
    let mut key = facet;
    key.sort_unstable();
    let at = facet.iter().position(|k| *k == key[0]).unwrap_or(0);
    (key, facet[(at + 1) % 3] == key[1])
}

fn area([a, b, c]: Triangle) -> f64 {
    0.5 * norm(cross(minus(b, a), minus(c, a)))
}

/// `(1, 2.5, -3) mm`.
fn place_mm(place_m: [f64; 3]) -> String {
    let [x, y, z] = place_m.map(|c| {
        let text = format!("{:.4}", 1e3 * c);
        let short = text.trim_end_matches('0').trim_end_matches('.');
        if short == "-0" {
            "0".to_owned()
        } else {
            short.to_owned()
        }
    });
    format!("({x}, {y}, {z}) mm")
}
