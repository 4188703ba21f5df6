//! What every command needs of a design: the source, the coils, the magnet, the currents.

use rayon::prelude::*;

use super::JobError;
use crate::bundle::manifest::{ArrayGeometry, CurrentLimits, MagnetSummary};
use crate::coil::circuit::{self, Circuit};
use crate::design::{Coil, Coupling, Design, MagnetModel, Polarity};
use crate::field::batch::Wanted;
use crate::field::dipole;
use crate::field::winding::{OnEdge, Winding};
use crate::map::tabulate::PlacedCoil;
use crate::progress::Progress;

/// Points handed to one thread at a time; fixed, so that bytes do not depend on threads.
const PORTION: usize = 4096;

/// A design made ready for computing.
#[derive(Debug, Clone)]
pub struct Scene<'a> {
    /// The design.
    pub design: &'a Design,
    /// Its coil section.
    pub coil: Coil,
    /// The winding.
    pub winding: Winding,
    /// Resistance, inductance, wire.
    pub circuit: Circuit,
    /// The coils of the array.
    pub coils: Vec<PlacedCoil>,
    /// The magnet's moment, A m^2.
    pub moment_a_m2: [f64; 3],
    /// Lower current limit of each coil, A: the driver's or minus the supply's V/R.
    pub lower_a: Vec<f64>,
    /// Upper current limit of each coil, A: the lower of the driver's and the supply's V/R.
    pub upper_a: Vec<f64>,
}

impl<'a> Scene<'a> {
    /// Makes a design ready.
    ///
    /// # Errors
    /// [`JobError::NotModelled`] for a steel core or a cylindrical magnet, which this version
    /// does not compute: no wrong number is given.
    pub fn new(design: &'a Design) -> Result<Self, JobError> {
        if design.core.is_some() {
            return Err(JobError::NotModelled(format!(
                "[core]: steel cores are not modelled by this version, and without the core the \
                 force of {:?} would be several times too small; leave the section out for an \
                 air coil (designs/seed_air.toml is the seed's array without cores)",
                design.name
            )));
        }
        if design.magnet.model == MagnetModel::Cylinder {
            return Err(JobError::NotModelled(
                "magnet.model: the finite cylinder is not modelled by this version; \
                 use model = \"dipole\" (at 30 mm the seed's magnet differs by 0.7 %)"
                    .to_owned(),
            ));
        }
        let coil = design.coil.ok_or_else(|| {
            JobError::Input("the design has no [coil] section, which this command needs".to_owned())
        })?;
        let circuit = Circuit::of_air_coil(&coil, &design.wire);
        let coils = design
            .array
            .positions_m
            .iter()
            .zip(&design.array.gain)
            .enumerate()
            .map(|(number, (axis_m, gain))| PlacedCoil {
                number,
                axis_m: *axis_m,
                gain: *gain,
            })
            .collect();
        let magnet = &design.magnet;
        let moment = dipole::cylinder_moment_a_m2(
            magnet.diameter_m,
            magnet.length_m,
            magnet.magnetization_a_per_m,
        );
        let along_z = match magnet.polarity {
            Polarity::Repel => -moment,
            Polarity::Attract => moment,
        };
        let voltage_v = design.supply.voltage_v;
        let rated = |limit: &f64| circuit.rated_current_a(*limit, voltage_v);
        Ok(Self {
            design,
            coil,
            winding: circuit::winding(&coil, &design.wire),
            coils,
            moment_a_m2: dipole::tilted_moment_a_m2(along_z, magnet.tilt_deg),
            upper_a: design.supply.current_max_a.iter().map(rated).collect(),
            lower_a: design
                .supply
                .current_min_a
                .iter()
                .map(|l| -rated(&-l))
                .collect(),
            circuit,
        })
    }

    /// The rated current of one coil: the largest of the array's upper limits, A.
    #[must_use]
    pub fn rated_current_a(&self) -> f64 {
        self.upper_a.iter().copied().fold(0.0, f64::max)
    }

    /// Whether the moment is tilted, so that the force needs the whole gradient.
    #[must_use]
    pub fn tilted(&self) -> bool {
        self.moment_a_m2[0] != 0.0 || self.moment_a_m2[1] != 0.0
    }

    /// Resistance of every coil, ohm.
    #[must_use]
    pub fn resistances_ohm(&self) -> Vec<f64> {
        vec![self.circuit.resistance_ohm; self.coils.len()]
    }

    /// Upward force per ampere of every coil at every point, N/A, [point, coil], each to
    /// `tolerance` relative to the largest |grad B| at the point's height: directly at the
    /// points, not through a map.
    ///
    /// # Errors
    /// A point on a winding's edge; interruption.
    pub fn forces_n_per_a(
        &self,
        points_m: &[[f64; 3]],
        tolerance: f64,
        progress: &dyn Progress,
    ) -> Result<Vec<f64>, JobError> {
        let coils = self.coils.len();
        let mut forces = vec![0.0; points_m.len() * coils];
        progress.begin("forces", points_m.len() as u64);
        forces
            .par_chunks_mut(PORTION * coils)
            .zip(points_m.par_chunks(PORTION))
            .try_for_each(|(rows, points)| -> Result<(), JobError> {
                progress.check()?;
                for (column, coil) in self.coils.iter().enumerate() {
                    self.force_column(coil, points, tolerance, |row, force| {
                        rows[row * coils + column] = force;
                    })?;
                }
                progress.advance(points.len() as u64);
                Ok(())
            })?;
        progress.end();
        Ok(forces)
    }

    fn force_column(
        &self,
        coil: &PlacedCoil,
        points_m: &[[f64; 3]],
        tolerance: f64,
        mut put: impl FnMut(usize, f64),
    ) -> Result<(), OnEdge> {
        let offset = |p: &[f64; 3]| (p[0] - coil.axis_m[0], p[1] - coil.axis_m[1]);
        let r_m: Vec<f64> = points_m
            .iter()
            .map(|p| {
                let (dx, dy) = offset(p);
                dx.hypot(dy)
            })
            .collect();
        let z_m: Vec<f64> = points_m.iter().map(|p| p[2]).collect();
        let wanted = if self.tilted() {
            Wanted::Gradient
        } else {
            Wanted::Gz
        };
        let gradients = self.winding.gradients(&r_m, &z_m, tolerance, wanted)?;
        let [m_x, m_y, m_z] = self.moment_a_m2;
        for (row, point) in points_m.iter().enumerate() {
            let mut force = m_z * gradients.dbz_dz[row];
            if self.tilted() {
                // dB_x/dz = (dx / r) dB_r/dz, and the same along y.
                let (dx, dy) = offset(point);
                force += gradients.dbr_dz_over_r[row] * (m_x * dx + m_y * dy);
            }
            put(row, coil.gain * force);
        }
        Ok(())
    }

    /// The array as artefacts tell it.
    #[must_use]
    pub fn array_geometry(&self) -> ArrayGeometry {
        ArrayGeometry {
            positions_m: self.design.array.positions_m.clone(),
            coupling: match self.design.array.coupling {
                Coupling::Full => "full",
                Coupling::None => "none",
            }
            .to_owned(),
            gain: self.design.array.gain.clone(),
        }
    }

    /// The current limits as artefacts tell them.
    #[must_use]
    pub fn current_limits(&self) -> CurrentLimits {
        CurrentLimits {
            current_min_a: self.lower_a.clone(),
            current_max_a: self.upper_a.clone(),
            total_current_max_a: self.design.supply.total_current_max_a,
        }
    }

    /// The magnet as artefacts tell it.
    #[must_use]
    pub fn magnet_summary(&self) -> MagnetSummary {
        let magnet = &self.design.magnet;
        MagnetSummary {
            moment_a_m2: self.moment_a_m2,
            model: "dipole".to_owned(),
            polarity: match magnet.polarity {
                Polarity::Repel => "repel",
                Polarity::Attract => "attract",
            }
            .to_owned(),
            diameter_m: magnet.diameter_m,
            length_m: magnet.length_m,
        }
    }
}
