//! The bundle that inputs and options give, computed in memory: what `verify` compares with.

use super::BothSolved;
use super::CalibrateOptions;
use super::Calibration;
use super::DESIGN_FILE;
use super::Inductances;
use super::LambdaReport;
use crate::RunError;
use crate::bundle::cache::Store;
use crate::bundle::lambda_file::LambdaFile;
use crate::bundle::manifest::Manifest;
use crate::bundle::npz::Array;
use crate::bundle::table::PointRow;
use crate::bundle::write::{BundleContent, sealed_manifest};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cached_field::FieldStore;
use crate::scene::sources::DesignSource;
use crate::scene::sources::ShapeSource;

/// The expected content of a bundle. The digests in the manifest's list stand for the content of all files.
#[derive(Debug, Clone)]
pub struct Expected {
    /// `manifest.json`.
    pub manifest: Manifest,
    /// `lambda.json`.
    pub lambda: LambdaFile,
    /// `points.csv`.
    pub points: Vec<PointRow>,
    /// Names of the files that are copies of its inputs.
    pub copies: Vec<String>,
    /// The arrays of `map.npz`.
    pub map: Vec<Array<'static>>,
    /// How its points count in the mean; `None`: all alike.
    pub weights: Option<Vec<f64>>,
}

/// Computes the bundle of `shape` on `scene` again. Nothing is written, and nothing that an
/// earlier run cached is used.
///
/// # Errors
/// As [`super::run`], but for what concerns the output.
pub fn expected(
    scene: &Scene,
    source: DesignSource,
    shape: &ShapeSource,
    options: &CalibrateOptions,
    progress: &dyn Progress,
) -> Result<Expected, RunError> {
    let options = &options.for_shape(shape);
    let scene = &scene.to_tolerance(options.lambda.tolerance_for(scene.design));
    let field = FieldStore::new(scene, Store::none());
    let solved = BothSolved::new(scene, &field, progress)?;
    let circuit = Inductances::new(scene, &solved.map, progress);
    let calibration = Calibration {
        scene,
        solved: &solved,
        source,
        circuit: &circuit,
        field: field.of_shape(&shape.document.name),
        shape,
        checked: &[],
        options,
    };
    let object = calibration.points(progress)?;
    let seal = |content: &BundleContent, _: &LambdaReport| {
        let arrays = content.map.arrays().into_iter().map(Array::into_owned);
        Ok((sealed_manifest(content)?, arrays.collect()))
    };
    let ((manifest, map), lambda) = calibration.compute(&object, progress, seal)?;
    let forces = object.force_points(&calibration);
    let named = scene.files.iter().map(|file| file.kept_name.clone());
    Ok(Expected {
        manifest,
        copies: std::iter::once(DESIGN_FILE.to_owned())
            .chain(named)
            .collect(),
        map,
        weights: forces.weights().map(<[f64]>::to_vec),
        points: forces.rows(),
        lambda: lambda.file,
    })
}
