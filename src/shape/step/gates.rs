//! What a body made of STEP must hold before it is believed.
//!
//! A wrong body rarely holds all of this: closed, one sense, the topology that the file states,
//! volume and area that stay when the mesh is made finer, and every vertex of the file in its box.

use crate::document::SurfaceFormat;
use crate::inspect::MeshReport;
use crate::mesh::{FileMesh, Triangle};

/// Volume and area of a coarse and a four times finer mesh may differ by so much of the finer's.
const MOST_CHANGE: f64 = 0.02;

/// What the file itself states of a shell.
pub(super) struct Stated {
    pub(super) vertices: Vec<[f64; 3]>,
    /// V - E + F - (loops - F) of the shell.
    pub(super) euler: i64,
}

/// The same shell meshed twice, with the chord tolerances, in the file's unit.
pub(super) struct Meshed {
    pub(super) coarse: (f64, Vec<Triangle>),
    pub(super) fine: (f64, Vec<Triangle>),
    /// Vertices nearer than this are one.
    pub(super) weld: f64,
}

/// Why a shell is not believed; `Ok` if it is.
pub(super) fn check(stated: &Stated, meshed: &Meshed) -> Result<(), String> {
    let (coarse_tol, coarse) = &meshed.coarse;
    let (_, fine) = &meshed.fine;
    let report = |triangles: &Vec<Triangle>| {
        let file = FileMesh {
            triangles: triangles.clone(),
            coordinate_rounding: 0.5 * meshed.weld,
            ..FileMesh::default()
        };
        MeshReport::of_edges(SurfaceFormat::Step, &file)
    };
    let (coarse, fine) = (report(coarse), report(fine));
    for mesh in [&coarse, &fine] {
        if !mesh.watertight {
            return Err(format!(
                "its surface is not closed ({} open edges)",
                mesh.open_edges + mesh.crowded_edges
            ));
        }
        if mesh.euler != stated.euler {
            return Err(format!(
                "its surface has the Euler characteristic {}, but the file states {}",
                mesh.euler, stated.euler
            ));
        }
    }
    let (Some(v1), Some(v2)) = (coarse.volume, fine.volume) else {
        return Err("its triangles do not look to one side".into());
    };
    let most = (MOST_CHANGE * v2.abs()).min(2.0 * coarse_tol * fine.area);
    if (v1 - v2).abs() > most || v2 == 0.0 {
        return Err(format!("its volume does not settle ({v1} and {v2})"));
    }
    if (coarse.area - fine.area).abs() > MOST_CHANGE * fine.area {
        let areas = (coarse.area, fine.area);
        return Err(format!(
            "its area does not settle ({} and {})",
            areas.0, areas.1
        ));
    }
    let inside = |p: &[f64; 3]| {
        (0..3).all(|k| {
            p[k] >= fine.bounds_min[k] - coarse_tol && p[k] <= fine.bounds_max[k] + coarse_tol
        })
    };
    if !stated.vertices.iter().all(inside) {
        return Err("vertices of the file lie outside its surface's box".into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed box from the origin, its triangles in order outwards.
    fn block(sides: [f64; 3]) -> Vec<Triangle> {
        let corner = |n: usize| [0, 1, 2].map(|k| if n >> k & 1 == 1 { sides[k] } else { 0.0 });
        [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ]
        .into_iter()
        .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
        .map(|triangle| triangle.map(corner))
        .collect()
    }

    /// A box of 0.7, 1.3 and 2.9 units, whose coarse mesh is `grown` times as large.
    fn verdict(unit: f64, grown: f64, chord: f64) -> Result<(), String> {
        let sides = [0.7, 1.3, 2.9].map(|side| side * unit);
        let fine = block(sides);
        let stated = Stated {
            vertices: fine.as_flattened().to_vec(),
            euler: 2,
        };
        let meshed = Meshed {
            coarse: (chord * unit, block(sides.map(|side| side * grown))),
            fine: (0.25 * chord * unit, fine),
            weld: 1e-7 * unit,
        };
        check(&stated, &meshed)
    }

    #[test]
    fn the_verdict_is_the_same_in_every_unit() {
        for unit in [1e-3, 1.0, 1e3] {
            let told = |grown: f64, chord: f64| verdict(unit, grown, chord).unwrap_err();
            // The volume grows three times as much as the sides, the area twice.
            assert_eq!(verdict(unit, 1.006, 0.1), Ok(()));
            assert_eq!(verdict(unit, 0.994, 0.1), Ok(()));
            assert!(told(1.008, 0.1).contains("its volume does not settle"));
            assert!(told(0.992, 0.1).contains("its volume does not settle"));
            // 0.047 of a volume over an area of 13.4 are beyond twice this chord.
            assert!(told(1.006, 1.7e-3).contains("its volume does not settle"));
            assert_eq!(verdict(unit, 1.006, 1.9e-3), Ok(()));
        }
    }
}
