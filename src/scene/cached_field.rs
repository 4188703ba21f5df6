//! A design's field, cached from run to run beside its bundles.
//!
//! The field of coils, steel and magnet does not depend on current limits, criteria or the
//! just-noticeable difference: as long as those alone change, steel, forces and maps are read and
//! not computed. What is read is what was computed, to the bit.

use std::fmt;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::Scene;
use super::maps::{MagnetMean, SceneMap};
use super::passive;
use super::shard::Shard;
use super::steel::{self, Solved};
use crate::RunError;
use crate::bundle::artefact::Input;
use crate::bundle::cache::{Origin, Store};

/// Digest of the sources of this build.
const BUILD: &str = env!("FLUXFORM_BUILD");
use crate::design::Steel as Described;
use crate::field::steel::array::{CoupledArray, MOST_WHOLE};
use crate::field::steel::array_request::{Choice, DriveCache, SolvedBlock};
use crate::field::steel::core_flux_density::{Inspection, peak_depth_m};
use crate::field::steel::passive::Region;
use crate::field::winding::OnEdge;
use crate::map::Components;
use crate::map::tabulate::{Grid, PlacedCoil};
use crate::progress::Progress;
use crate::shape::document::ShapeDocument;

/// Name of the folder beside a design's bundles.
pub const STORE_FOLDER: &str = ".fluxform-cache";
/// Most values of a map that is held for the next shape.
const MOST_NODES_HELD: usize = 8_000_000;
/// Entry of the design's steel.
const STEEL: &str = "steel";
/// Until it is there: of the resolution that was chosen for many coupled cores.
const CHOICE: &str = "steel-choice";

/// Until the steel is there: the entry of a block of the drives of many coupled cores.
fn block(number: usize) -> String {
    format!("steel-block-{number}")
}

/// Points and the forces at them, N/A.
type TriedForces = (Vec<[f64; 3]>, Vec<f64>);

/// A part of the drives of coupled cores, in blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct SteelPart {
    /// All blocks.
    pub blocks: usize,
    /// Those of the part.
    #[serde(rename = "blocks_of_shard")]
    pub of: usize,
    /// Those of the part that were solved now; the others were there.
    pub solved: usize,
}

/// Where a design's field is cached.
#[derive(Debug)]
pub struct FieldStore {
    store: Store,
    /// The same, for what does not depend on the design: cached without steel too.
    shapes: Store,
    field: Origin,
    /// Of the design's array, once a shape needs it.
    inspection: OnceLock<Inspection>,
    /// The pull that the design leaves out, over the region of the last shape.
    pull: Mutex<Option<(Region, Arc<Option<passive::Pull>>)>>,
    /// Points at which forces were computed while points were chosen, and the forces.
    tried: Mutex<Vec<TriedForces>>,
    /// The last shape's map and the digest of what it was made from.
    last_map: Mutex<Option<([u8; 32], SceneMap)>>,
}

impl DriveCache for FieldStore {
    fn choice(&self) -> Option<Choice> {
        self.store.recall(CHOICE, &self.field)
    }

    fn keep_choice(&self, choice: &Choice) {
        self.store.keep(CHOICE, &self.field, choice);
    }

    fn block(&self, number: usize) -> Option<SolvedBlock> {
        self.store.recall(&block(number), &self.field)
    }

    fn keep_block(&self, number: usize, solved: &SolvedBlock) {
        self.store.keep(&block(number), &self.field, solved);
    }
}

impl FieldStore {
    /// The field of `scene` in `store`. Without steel nothing is cached: computing is faster than reading.
    #[must_use]
    pub fn new(scene: &Scene, store: Store) -> Self {
        let design = scene.design;
        let shapes = store.clone();
        let store = if design.has_steel() {
            store
        } else {
            Store::none()
        };
        // Debug text holds every number to the last bit.
        let parts = format!(
            "{:?}",
            (
                &design.coil,
                &design.wire,
                &design.core,
                (&design.plate, &design.iron),
                &design.array,
                &design.magnet,
                design.workspace.z_m.from,
                scene.tolerances,
            )
        );
        let mut field = Origin::of_build(BUILD).and(parts.as_bytes());
        if let Some(Described::Curve(_)) = design.core.as_ref().map(|core| &core.steel) {
            // Along a curve the rated current counts too, and the height at which linear cores are those of the curve.
            let along_curve = (&design.supply, design.target_height_m);
            field = field.and(format!("{along_curve:?}").as_bytes());
        }
        for file in &scene.files {
            field = field.and(&file.bytes);
        }
        Self {
            store,
            shapes,
            field,
            inspection: OnceLock::new(),
            pull: Mutex::new(None),
            tried: Mutex::default(),
            last_map: Mutex::new(None),
        }
    }

    /// Whether the steel's solution is there from an earlier run.
    #[must_use]
    pub fn holds_steel(&self) -> bool {
        self.store.holds(STEEL, &self.field)
    }

    /// As [`steel::solve`], as finely as maps need it.
    ///
    /// # Errors
    /// As [`steel::solve`].
    pub fn steel(&self, scene: &Scene) -> Result<Solved, RunError> {
        let lowest_m = scene.design.workspace.z_m.from;
        if let Some(solved) = self.store.recall(STEEL, &self.field) {
            return Ok(solved);
        }
        let solved = steel::solve_with(scene, scene.tolerances.map, lowest_m, self)?;
        self.store.keep(STEEL, &self.field, &solved);
        if self.holds_steel() {
            // It holds all of its blocks.
            self.store.forget(CHOICE);
            (1..)
                .map(block)
                .take_while(|name| self.store.forget(name))
                .for_each(drop);
        }
        Ok(solved)
    }

    /// Solves `shard` of the blocks of drives of the coupled cores of `scene`, for [`FieldStore::steel`] to find.
    ///
    /// # Errors
    /// As [`steel::solve`]; a design whose drives are not solved in blocks; a cache that cannot be written.
    pub fn steel_part(&self, scene: &Scene, shard: Shard) -> Result<SteelPart, RunError> {
        let lowest_m = scene.design.workspace.z_m.from;
        let Some(request) = steel::in_blocks(scene, scene.tolerances.map, lowest_m)? else {
            return Err(RunError::Input(format!(
                "--shard splits the drives of more than {MOST_WHOLE} cored coils that are coupled, and this \
                 design has no such: leave --shard out, one run solves its steel"
            )));
        };
        let blocks = request.blocks();
        let numbers = shard.of(blocks as u64);
        let numbers = numbers.start as usize..numbers.end as usize;
        let of = numbers.len();
        if self.holds_steel() {
            let solved = 0;
            return Ok(SteelPart { blocks, of, solved });
        }
        let solved = request.solve_blocks(numbers.clone(), self)?;
        let held = |number: usize| match number {
            0 => self.store.holds(CHOICE, &self.field),
            number => self.store.holds(&block(number), &self.field),
        };
        if numbers.into_iter().all(held) {
            return Ok(SteelPart { blocks, of, solved });
        }
        Err(RunError::Input(format!(
            "what was solved cannot be kept in {STORE_FOLDER} beside the design's bundles, where other runs look for \
             it: make the folder writable, or give another --out"
        )))
    }

    /// The part that one shape needs.
    #[must_use]
    pub fn of_shape<'a>(&'a self, name: &'a str) -> ShapeField<'a> {
        ShapeField {
            cached: Some((self, name)),
        }
    }
}

/// The part of a design's field that one shape needs.
#[derive(Debug, Clone, Copy, Default)]
pub struct ShapeField<'a> {
    cached: Option<(&'a FieldStore, &'a str)>,
}

impl<'a> ShapeField<'a> {
    /// As [`Scene::forces_n_per_a`]; `what` is their name among the points of the shape.
    ///
    /// # Errors
    /// As [`Scene::forces_n_per_a`].
    pub fn forces_n_per_a(
        self,
        what: &str,
        scene: &Scene,
        solved: &Solved,
        points_m: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<f64>, RunError> {
        self.at_points(what, points_m, || match self.tried(points_m) {
            Some(forces_n_per_a) => Ok(forces_n_per_a),
            None => scene.forces_n_per_a(solved, points_m, progress),
        })
    }

    /// As [`Scene::forces_n_per_a`] while points are chosen: cached for the rest of this run, since some of those
    /// that are tried are taken.
    ///
    /// # Errors
    /// As [`Scene::forces_n_per_a`].
    pub fn tried_forces_n_per_a(
        self,
        scene: &Scene,
        solved: &Solved,
        points_m: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<f64>, RunError> {
        if let Some(forces_n_per_a) = self.tried(points_m) {
            return Ok(forces_n_per_a);
        }
        let forces_n_per_a = scene.forces_n_per_a(solved, points_m, progress)?;
        if let Some((FieldStore { tried, .. }, _)) = self.cached {
            let mut tried = tried.lock().unwrap_or_else(PoisonError::into_inner);
            let values = |tried: &[(Vec<[f64; 3]>, Vec<f64>)]| -> usize {
                tried.iter().map(|(_, forces)| forces.len()).sum()
            };
            while !tried.is_empty() && values(&tried) + forces_n_per_a.len() > MOST_NODES_HELD {
                tried.remove(0);
            }
            tried.push((points_m.to_vec(), forces_n_per_a.clone()));
        }
        Ok(forces_n_per_a)
    }

    /// The forces at these points, if they were tried.
    fn tried(self, points_m: &[[f64; 3]]) -> Option<Vec<f64>> {
        let (FieldStore { tried, .. }, _) = self.cached?;
        let tried = tried.lock().unwrap_or_else(PoisonError::into_inner);
        let same = tried.iter().find(|(points, _)| points == points_m);
        same.map(|(_, forces_n_per_a)| forces_n_per_a.clone())
    }

    /// As [`Scene::force_vectors_n_per_a`]; `what` as in [`Self::forces_n_per_a`].
    ///
    /// # Errors
    /// As there.
    pub fn force_vectors_n_per_a(
        self,
        what: &str,
        scene: &Scene,
        solved: &Solved,
        points_m: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<[f64; 3]>, RunError> {
        self.at_points(what, points_m, || {
            scene.force_vectors_n_per_a(solved, points_m, progress)
        })
    }

    /// The cached result of `compute` at points of the shape, by its name.
    fn at_points<T: Serialize + DeserializeOwned>(
        self,
        what: &str,
        points_m: &[[f64; 3]],
        compute: impl FnOnce() -> Result<T, RunError>,
    ) -> Result<T, RunError> {
        let Some((FieldStore { store, field, .. }, shape)) = self.cached else {
            return compute();
        };
        let origin = field
            .clone()
            .and_numbers(points_m.iter().flatten().copied());
        store.remember(&format!("{shape}.{what}"), &origin, compute)
    }

    /// The vertical pull of the unpowered steel at `points_m` where the design leaves it out, N; empty
    /// without steel. It is solved once for objects that are about as high.
    ///
    /// # Errors
    /// A magnet that touches the steel.
    pub fn pull_left_out_n(
        self,
        scene: &Scene,
        points_m: &[[f64; 3]],
    ) -> Result<Vec<f64>, RunError> {
        self.at_points("pull", points_m, || {
            let region = passive::left_out_region(scene, points_m);
            let solve = || passive::left_out(scene, region).map(Arc::new);
            let pull = match self.cached {
                Some((FieldStore { pull, .. }, _)) => {
                    let mut held = pull.lock().unwrap_or_else(PoisonError::into_inner);
                    match &*held {
                        Some((of, pull)) if *of == region => Arc::clone(pull),
                        _ => Arc::clone(&held.insert((region, solve()?)).1),
                    }
                }
                None => solve()?,
            };
            let pull = pull.as_ref().as_ref();
            Ok(pull.map_or_else(Vec::new, |pull| {
                passive::left_out_z_n(scene, pull, points_m)
            }))
        })
    }

    /// The largest |B| in any core of the design's `array` at these currents, T, as
    /// [`CoupledArray::core_fields`] has it.
    ///
    /// # Errors
    /// As [`CoupledArray::core_fields`].
    pub fn peak_t(self, array: &CoupledArray, currents_a: &[f64]) -> Result<f64, OnEdge> {
        let depth_m = peak_depth_m(array.response.outline.shape);
        let most = |peaks: Vec<f64>| peaks.into_iter().fold(0.0, f64::max);
        let Some((cached, shape)) = self.cached else {
            let inspection = Inspection::new(array, depth_m)?;
            return inspection.peaks_t(array, currents_a).map(most);
        };
        let numbers = currents_a.iter().copied().chain([depth_m]);
        let origin = cached.field.clone().and_numbers(numbers);
        cached
            .store
            .remember(&format!("{shape}.peak"), &origin, || {
                let inspection = match cached.inspection.get() {
                    Some(inspection) => inspection,
                    None => {
                        let made = Inspection::new(array, depth_m)?;
                        cached.inspection.get_or_init(|| made)
                    }
                };
                inspection.peaks_t(array, currents_a).map(most)
            })
    }

    /// The entry of what is known of the points of `document`, read from `inputs`; `what` is its name among those
    /// of that shape.
    #[must_use]
    pub fn points(self, what: &str, document: &ShapeDocument, inputs: &[Input]) -> Entry<'a> {
        self.of_surface(what, document, inputs, "")
    }

    /// The entry of the search for samples of `document`, read from `inputs`; `what` is its name among the searches
    /// for that shape, and the debug text of `asked` all that it depends on beside the field.
    #[must_use]
    pub fn search(
        self,
        what: &str,
        document: &ShapeDocument,
        inputs: &[Input],
        asked: &impl fmt::Debug,
    ) -> Entry<'a> {
        let field = self.cached.map(|(cached, _)| cached.field.sum());
        let asked = format!("{:?}", (field, asked));
        self.of_surface(&format!("{what}-search"), document, inputs, &asked)
    }

    fn of_surface(
        self,
        what: &str,
        document: &ShapeDocument,
        inputs: &[Input],
        asked: &str,
    ) -> Entry<'a> {
        let text = format!("{document:?}{asked}");
        let origin = inputs.iter().fold(
            Origin::of_build(BUILD).and(text.as_bytes()),
            |origin, input| origin.and(input.sha256.as_bytes()),
        );
        Entry {
            store: self.cached.map(|(field, _)| &field.shapes),
            name: format!("{}.{what}", document.name),
            origin,
        }
    }

    /// As [`SceneMap::new`].
    ///
    /// # Errors
    /// As [`SceneMap::new`].
    #[expect(clippy::too_many_arguments, reason = "those of SceneMap::new")]
    pub fn map(
        self,
        scene: &Scene,
        solved: &Solved,
        coils: &[PlacedCoil],
        grid: &Grid,
        components: Components,
        magnet: &MagnetMean,
        progress: &dyn Progress,
    ) -> Result<SceneMap, RunError> {
        let compute = || SceneMap::new(scene, solved, coils, grid, components, magnet, progress);
        let Some((cached, _)) = self.cached else {
            return compute();
        };
        let FieldStore {
            store,
            field,
            last_map,
            ..
        } = cached;
        let coils: Vec<usize> = coils.iter().map(|coil| coil.number).collect();
        let what = format!("{:?}", (coils, components, magnet));
        let of_grid = |origin: Origin| {
            let axes = [&grid.x_m, &grid.y_m, &grid.z_m].into_iter();
            axes.fold(origin, |origin, nodes| {
                origin.and_numbers(nodes.iter().copied())
            })
        };
        // Objects as wide and as high have the same map; another design's or processor's takes its
        // place, and there are never more than 256.
        let kind = Origin::default().and(components.name().as_bytes());
        let name = format!("map-{:02x}", of_grid(kind).sum()[0]);
        let origin = of_grid(field.clone().and(what.as_bytes()));
        let sum = origin.sum();
        let mut last = last_map.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, map)) = last.as_ref().filter(|(of, _)| *of == sum) {
            return Ok(map.clone());
        }
        let made = store.remember(&name, &origin, compute)?;
        let small = made.map.gz_t_per_m_per_a.len() <= MOST_NODES_HELD;
        *last = small.then(|| (sum, made.clone()));
        Ok(made)
    }
}

/// A cached result of a shape's surface.
#[derive(Debug)]
pub struct Entry<'a> {
    store: Option<&'a Store>,
    name: String,
    origin: Origin,
}

impl Entry<'_> {
    /// The result of an earlier run, or what `compute` gives, which is kept.
    ///
    /// # Errors
    /// Those of `compute`.
    pub fn remember<T: Serialize + DeserializeOwned, E>(
        &self,
        compute: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E> {
        match self.store {
            Some(store) => store.remember(&self.name, &self.origin, compute),
            None => compute(),
        }
    }

    /// The result of an earlier run.
    #[must_use]
    pub fn known<T: DeserializeOwned>(&self) -> Option<T> {
        self.store?.recall(&self.name, &self.origin)
    }

    /// Keeps what was found.
    pub fn keep(&self, found: &impl Serialize) {
        if let Some(store) = self.store {
            store.keep(&self.name, &self.origin, found);
        }
    }
}
