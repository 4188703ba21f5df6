//! `map.npz`: axes, coil indices, maps per ampere, and what else a runtime needs.
//!
//! A stored zip of NPY 1.0 arrays with fixed time stamps: the same numbers give the same bytes.
//! Beside the contract's arrays it holds the few numbers a runtime needs, so that C and MATLAB
//! programs need not read JSON: `schema_version` (i64, 3), `moment_a_m2` (3), and one entry a coil
//! of the array: `current_min_a`, `current_max_a`, `resistance_ohm`; where there are such,
//! `total_current_max_a` and `lambda_n_per_m` (no dimension). `coil` holds the indices of the
//! coils whose maps were kept; the others give no force. `passive_force_n`, where it is there, is
//! what the unpowered steel adds to the force. What else a bundle's runtime needs to follow a
//! finger is described in [`super::rendering`].

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::array_check::{LARGEST, bad, check_nodes};
use super::artefact::{SCHEMA_VERSION, check_version, parse_version};
use super::npy;
use super::rendering::{
    DIRECTION, HAS_HEIGHT, HEIGHT, HEIGHT_X, HEIGHT_Y, HeightGrid, INDUCTANCE, ROBUST, Rendering,
    Requested, SIDEWAYS_WEIGHT, STATIC_CURRENT, VOLTAGE,
};
use super::stored;
use fluxform_lambda::uncertainty::RobustRuntime;

pub use super::array_check::{Array, NpzError};

#[cfg(target_endian = "big")]
compile_error!("arrays are written as they lie in memory, which must be little-endian");

/// The arrays of `map.npz`. All lengths in metres, fields and gradients per ampere.
#[derive(Debug, Clone, PartialEq)]
pub struct MapArrays<'a> {
    /// Nodes along x, m, strictly increasing.
    pub x_m: Cow<'a, [f64]>,
    /// Nodes along y, m, strictly increasing.
    pub y_m: Cow<'a, [f64]>,
    /// Nodes along z, m, strictly increasing.
    pub z_m: Cow<'a, [f64]>,
    /// Indices of the coils whose maps follow, strictly increasing.
    pub coil: Cow<'a, [i64]>,
    /// dB_z/dz, `[coil, z, y, x]`, T/m/A.
    pub gz_t_per_m_per_a: Cow<'a, [f64]>,
    /// dB_x/dz and dB_y/dz, each `[coil, z, y, x]`, T/m/A: with `gz_t_per_m_per_a` all three components
    /// of the force on an upright magnet.
    pub sides_t_per_m_per_a: Option<[Cow<'a, [f64]>; 2]>,
    /// dB_i/dx_j, `[coil, z, y, x, i, j]`, T/m/A.
    pub gradient_t_per_m_per_a: Option<Cow<'a, [f64]>>,
    /// B, `[coil, z, y, x, 3]`, T/A.
    pub field_t_per_a: Option<Cow<'a, [f64]>>,
    /// Vertical pull of the unpowered steel on the magnet, `[z, y, x]`, N, positive upwards.
    pub passive_force_n: Option<Cow<'a, [f64]>>,
    /// dB_z/dz of all coils at the working point's currents, `[z, y, x]`, T/m.
    pub working_point_gz_t_per_m: Option<Cow<'a, [f64]>>,
    /// Data that a runtime needs in addition to the maps.
    pub runtime: Runtime,
}

/// Magnet, limits and force constant, as a runtime needs them.
#[derive(Debug, Clone, PartialEq)]
pub struct Runtime {
    /// The magnet's moment, A m^2.
    pub moment_a_m2: [f64; 3],
    /// Lower current limit of every coil of the array, A.
    pub current_min_a: Vec<f64>,
    /// Upper current limit of every coil of the array, A.
    pub current_max_a: Vec<f64>,
    /// Resistance of every coil of the array, ohm.
    pub resistance_ohm: Vec<f64>,
    /// Limit of the sum of the currents, A.
    pub total_current_max_a: Option<f64>,
    /// The chosen force constant, N/m.
    pub lambda_n_per_m: Option<f64>,
    /// Data for position feedback; `None` for maps without an object and for older bundles.
    pub rendering: Option<Rendering>,
}

const X: &str = "x_m";
const Y: &str = "y_m";
const Z: &str = "z_m";
const COIL: &str = "coil";
const GZ: &str = "gz_t_per_m_per_a";
/// dB_x/dz and dB_y/dz.
pub const SIDES: [&str; 2] = ["gx_t_per_m_per_a", "gy_t_per_m_per_a"];
const GRADIENT: &str = "gradient_t_per_m_per_a";
const FIELD: &str = "field_t_per_a";
/// The pull of the unpowered steel.
pub const PASSIVE: &str = "passive_force_n";
/// The whole map at a working point.
pub const WORKING_POINT: &str = "working_point_gz_t_per_m";
const VERSION: &str = "schema_version";
const MOMENT: &str = "moment_a_m2";
const CURRENT_MIN: &str = "current_min_a";
const CURRENT_MAX: &str = "current_max_a";
const RESISTANCE: &str = "resistance_ohm";
const TOTAL: &str = "total_current_max_a";
const LAMBDA: &str = "lambda_n_per_m";

impl MapArrays<'_> {
    /// `[coil, z, y, x]`.
    #[must_use]
    pub fn shape(&self) -> [usize; 4] {
        [
            self.coil.len(),
            self.z_m.len(),
            self.y_m.len(),
            self.x_m.len(),
        ]
    }

    /// dB_x/dz and dB_y/dz, where they are there.
    #[must_use]
    pub fn sides(&self) -> Option<[&[f64]; 2]> {
        let [x, y] = self.sides_t_per_m_per_a.as_ref()?;
        Some([x, y])
    }

    /// Its arrays of real numbers in the order of the file: all but the version and the coils' indices.
    #[must_use]
    pub fn arrays<'s>(&'s self) -> Vec<Array<'s>> {
        let [kept, nz, ny, nx] = self.shape();
        let runtime = &self.runtime;
        let coils = runtime.current_max_a.len();
        let mut arrays = vec![
            Array::new(X, &[nx], &*self.x_m),
            Array::new(Y, &[ny], &*self.y_m),
            Array::new(Z, &[nz], &*self.z_m),
            Array::new(GZ, &[kept, nz, ny, nx], &*self.gz_t_per_m_per_a),
        ];
        let mut add = |name, shape: &[usize], values: Option<&'s [f64]>| {
            arrays.extend(values.map(|values| Array::new(name, shape, values)));
        };
        for (name, values) in SIDES.into_iter().zip(self.sides().into_iter().flatten()) {
            add(name, &[kept, nz, ny, nx], Some(values));
        }
        let gradient = self.gradient_t_per_m_per_a.as_deref();
        add(GRADIENT, &[kept, nz, ny, nx, 3, 3], gradient);
        add(FIELD, &[kept, nz, ny, nx, 3], self.field_t_per_a.as_deref());
        add(PASSIVE, &[nz, ny, nx], self.passive_force_n.as_deref());
        let working_point = self.working_point_gz_t_per_m.as_deref();
        add(WORKING_POINT, &[nz, ny, nx], working_point);
        add(MOMENT, &[3], Some(&runtime.moment_a_m2));
        add(CURRENT_MIN, &[coils], Some(&runtime.current_min_a));
        add(CURRENT_MAX, &[coils], Some(&runtime.current_max_a));
        add(RESISTANCE, &[coils], Some(&runtime.resistance_ohm));
        let number = std::slice::from_ref;
        add(TOTAL, &[], runtime.total_current_max_a.as_ref().map(number));
        add(LAMBDA, &[], runtime.lambda_n_per_m.as_ref().map(number));
        let rendering = runtime.rendering.as_ref();
        arrays.extend(rendering.into_iter().flat_map(|it| it.arrays(coils)));
        arrays
    }

    /// Checks lengths, order of the axes, coil indices, and that every number is finite.
    ///
    /// # Errors
    /// The first array that is not as it must be.
    pub fn validate(&self) -> Result<(), NpzError> {
        for (name, nodes) in [(X, &self.x_m), (Y, &self.y_m), (Z, &self.z_m)] {
            if nodes.is_empty() || !nodes.is_sorted_by(|a, b| a < b) {
                return Err(bad(name, "must increase from node to node"));
            }
        }
        let coils = self.runtime.current_max_a.len();
        let ordered = self.coil.is_sorted_by(|a, b| a < b);
        let known = |&index: &i64| usize::try_from(index).is_ok_and(|index| index < coils);
        if !ordered || !self.coil.iter().all(known) {
            let message =
                format!("must hold increasing indices below {coils}, the number of coils");
            return Err(bad(COIL, message));
        }
        self.arrays().iter().try_for_each(Array::check)?;
        for (name, nodes) in [(X, &self.x_m), (Y, &self.y_m), (Z, &self.z_m)] {
            check_nodes(name, nodes)?;
        }
        let runtime = &self.runtime;
        let Some(rendering) = &runtime.rendering else {
            return Ok(());
        };
        rendering.validate()?;
        if rendering.requested.is_some() && self.sides_t_per_m_per_a.is_none() {
            return Err(NpzError::Missing(SIDES[0]));
        }
        // Position feedback divides by resistances, and may always command no current.
        if !runtime.resistance_ohm.iter().all(|&r| r >= 1.0 / LARGEST) {
            return Err(bad(RESISTANCE, "must be above 0"));
        }
        let enclosed = |(low, high): (&f64, &f64)| *low <= 0.0 && *high >= 0.0;
        let mut limits = runtime.current_min_a.iter().zip(&runtime.current_max_a);
        if !limits.all(enclosed) || runtime.total_current_max_a.is_some_and(|total| total < 0.0) {
            return Err(bad(CURRENT_MAX, "limits must enclose 0"));
        }
        Ok(())
    }
}

/// The bytes of `map.npz`.
///
/// # Errors
/// As [`MapArrays::validate`].
pub fn to_npz(map: &MapArrays) -> Result<Vec<u8>, NpzError> {
    map.validate()?;
    let arrays = map.arrays();
    let numbers: usize = arrays.iter().map(|array| array.values.len()).sum();
    let room = numbers * npy::ELEMENT_BYTES + (64 << 10);
    let mut archive = Archive(ZipWriter::new(Cursor::new(Vec::with_capacity(room))));
    archive
        .put_all(&map.coil, &arrays)
        .and_then(|()| archive.0.finish().map_err(io::Error::other))
        .map(Cursor::into_inner)
        .map_err(|error| NpzError::Archive(error.to_string()))
}

/// Arrays go into the archive in blocks of this size.
const BLOCK_BYTES: usize = 1 << 20;

struct Archive(ZipWriter<Cursor<Vec<u8>>>);

impl Archive {
    fn put_all(&mut self, coil: &[i64], arrays: &[Array]) -> io::Result<()> {
        let version: Vec<i64> = parse_version(SCHEMA_VERSION)
            .unwrap_or_default()
            .map(i64::from)
            .to_vec();
        self.put_i64(VERSION, &version)?;
        let (axes, others) = arrays.split_at(3);
        axes.iter().try_for_each(|array| self.put(array))?;
        self.put_i64(COIL, coil)?;
        others.iter().try_for_each(|array| self.put(array))
    }

    fn put(&mut self, array: &Array) -> io::Result<()> {
        let header = npy::header("<f8", &array.shape);
        self.put_bytes(array.name, &header, bytemuck::cast_slice(&array.values))
    }

    fn put_i64(&mut self, name: &str, values: &[i64]) -> io::Result<()> {
        self.put_bytes(
            name,
            &npy::header("<i8", &[values.len()]),
            bytemuck::cast_slice(values),
        )
    }

    fn put_bytes(&mut self, name: &str, header: &[u8], data: &[u8]) -> io::Result<()> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .last_modified_time(DateTime::DEFAULT)
            .unix_permissions(0o644)
            .large_file(data.len() as u64 > u64::from(u32::MAX) - 4096);
        self.0
            .start_file(format!("{name}.npy"), options)
            .map_err(io::Error::other)?;
        self.0.write_all(header)?;
        for block in data.chunks(BLOCK_BYTES) {
            // An archive of gigabytes is no reason to let a request to stop wait.
            fluxform_base::progress::poll();
            self.0.write_all(block)?;
        }
        Ok(())
    }
}

/// The arrays of an untrusted `map.npz`, an archive of the form that `stored` states. Nothing is
/// allocated beyond the file's own size; unknown arrays are passed over.
///
/// # Errors
/// [`NpzError`]: what is wrong, and with which array.
pub fn from_npz(bytes: &[u8]) -> Result<MapArrays<'static>, NpzError> {
    let mut arrays = Arrays(stored::entries(bytes).map_err(NpzError::Archive)?);
    let version: Vec<i64> = arrays.need(VERSION, &[Some(3)])?;
    let version: Vec<String> = version.iter().map(i64::to_string).collect();
    check_version(&version.join(".")).map_err(|message| bad(VERSION, message))?;
    let x_m: Vec<f64> = arrays.need(X, &[None])?;
    let y_m: Vec<f64> = arrays.need(Y, &[None])?;
    let z_m: Vec<f64> = arrays.need(Z, &[None])?;
    let coil: Vec<i64> = arrays.need(COIL, &[None])?;
    let [c, z, y, x] = [coil.len(), z_m.len(), y_m.len(), x_m.len()].map(Some);
    let moment: Vec<f64> = arrays.need(MOMENT, &[Some(3)])?;
    let current_max_a: Vec<f64> = arrays.need(CURRENT_MAX, &[None])?;
    let coils = Some(current_max_a.len());
    let gz: Vec<f64> = arrays.need(GZ, &[c, z, y, x])?;
    let sides = match SIDES.map(|name| arrays.get(name, &[c, z, y, x])) {
        [Ok(None), Ok(None)] => None,
        [Ok(Some(gx)), Ok(Some(gy))] => Some([Cow::Owned(gx), Cow::Owned(gy)]),
        [Ok(None), Ok(Some(_))] => return Err(NpzError::Missing(SIDES[0])),
        [Ok(Some(_)), Ok(None)] => return Err(NpzError::Missing(SIDES[1])),
        [Err(error), _] | [_, Err(error)] => return Err(error),
    };
    let gradient: Option<Vec<f64>> = arrays.get(GRADIENT, &[c, z, y, x, Some(3), Some(3)])?;
    let field: Option<Vec<f64>> = arrays.get(FIELD, &[c, z, y, x, Some(3)])?;
    let passive: Option<Vec<f64>> = arrays.get(PASSIVE, &[z, y, x])?;
    let working_point: Option<Vec<f64>> = arrays.get(WORKING_POINT, &[z, y, x])?;
    let map = MapArrays {
        x_m: x_m.into(),
        y_m: y_m.into(),
        z_m: z_m.into(),
        coil: coil.into(),
        gz_t_per_m_per_a: gz.into(),
        sides_t_per_m_per_a: sides,
        gradient_t_per_m_per_a: gradient.map(Cow::Owned),
        field_t_per_a: field.map(Cow::Owned),
        passive_force_n: passive.map(Cow::Owned),
        working_point_gz_t_per_m: working_point.map(Cow::Owned),
        runtime: Runtime {
            moment_a_m2: [moment[0], moment[1], moment[2]],
            current_min_a: arrays.need(CURRENT_MIN, &[coils])?,
            resistance_ohm: arrays.need(RESISTANCE, &[coils])?,
            current_max_a,
            total_current_max_a: arrays.scalar(TOTAL)?,
            lambda_n_per_m: arrays.scalar(LAMBDA)?,
            rendering: arrays.rendering(coils)?,
        },
    };
    map.validate()?;
    Ok(map)
}

/// Entries by name.
struct Arrays<'a>(BTreeMap<&'a [u8], &'a [u8]>);

/// Element types of arrays and what NPY calls them.
trait Element: bytemuck::Pod {
    const KIND: &'static str;
}

impl Element for f64 {
    const KIND: &'static str = "<f8";
}

impl Element for i64 {
    const KIND: &'static str = "<i8";
}

impl Arrays<'_> {
    fn need<T: Element>(
        &mut self,
        name: &'static str,
        shape: &[Option<usize>],
    ) -> Result<Vec<T>, NpzError> {
        self.get(name, shape)?.ok_or(NpzError::Missing(name))
    }

    /// All or nothing of what position feedback needs.
    fn rendering(&mut self, coils: Option<usize>) -> Result<Option<Rendering>, NpzError> {
        let Some(x_m) = self.get::<f64>(HEIGHT_X, &[None])? else {
            return Ok(None);
        };
        let y_m: Vec<f64> = self.need(HEIGHT_Y, &[None])?;
        let grid = [Some(y_m.len()), Some(x_m.len())];
        let of_nodes = [grid[0], grid[1], Some(3)];
        let requested = match self.get(DIRECTION, &of_nodes)? {
            None => None,
            Some(direction) => Some(Requested {
                direction,
                sideways_weight: self
                    .scalar(SIDEWAYS_WEIGHT)?
                    .ok_or(NpzError::Missing(SIDEWAYS_WEIGHT))?,
            }),
        };
        Ok(Some(Rendering {
            heights: HeightGrid {
                height_m: self.need(HEIGHT, &grid)?,
                has_height: self.need(HAS_HEIGHT, &grid)?,
                x_m,
                y_m,
            },
            static_current_a: self.need(STATIC_CURRENT, &[coils])?,
            inductance_h: self.need(INDUCTANCE, &[coils, coils])?,
            voltage_v: self.scalar(VOLTAGE)?,
            requested,
            robust: self
                .get::<f64>(ROBUST, &[Some(5)])?
                .map(|numbers| RobustRuntime {
                    price_n2_per_w: numbers[0],
                    sensor_m: numbers[1],
                    square: numbers[2],
                    mean: numbers[3],
                    driver_square: numbers[4],
                }),
        }))
    }

    fn scalar(&mut self, name: &'static str) -> Result<Option<f64>, NpzError> {
        Ok(self.get(name, &[])?.map(|values: Vec<f64>| values[0]))
    }

    /// The array of that shape (`None`: any length); `None` when there is no such array.
    fn get<T: Element>(
        &mut self,
        name: &'static str,
        shape: &[Option<usize>],
    ) -> Result<Option<Vec<T>>, NpzError> {
        let Some(entry) = self.0.remove(format!("{name}.npy").as_bytes()) else {
            return Ok(None);
        };
        let (found, data) = npy::parse(entry, T::KIND).map_err(|message| bad(name, message))?;
        let fits = |(want, size): (&Option<usize>, &usize)| want.is_none_or(|want| want == *size);
        if found.len() != shape.len() || !shape.iter().zip(&found).all(fits) {
            let want: Vec<String> = shape
                .iter()
                .map(|size| size.map_or("any".to_owned(), |size| size.to_string()))
                .collect();
            let message = format!("must have shape [{}], has {found:?}", want.join(", "));
            return Err(bad(name, message));
        }
        let mut values = vec![T::zeroed(); data.len() / npy::ELEMENT_BYTES];
        bytemuck::cast_slice_mut(&mut values).copy_from_slice(data);
        Ok(Some(values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn sample() -> MapArrays<'static> {
        let values = |n: usize, p: f64| (0..n).map(|i| (i as f64 * p).sin()).collect::<Vec<_>>();
        MapArrays {
            x_m: vec![-0.03, 0.01, 0.07].into(),
            y_m: vec![-0.02, 0.05].into(),
            z_m: vec![0.01, 0.02, 0.04, 0.09].into(),
            coil: vec![0, 2].into(),
            gz_t_per_m_per_a: values(48, 0.7).into(),
            sides_t_per_m_per_a: Some([values(48, 1.9).into(), values(48, 2.9).into()]),
            gradient_t_per_m_per_a: Some(values(48 * 9, 1.3).into()),
            field_t_per_a: Some(values(48 * 3, 2.1).into()),
            passive_force_n: Some(values(24, 1.7).into()),
            working_point_gz_t_per_m: Some(values(24, 1.3).into()),
            runtime: Runtime {
                moment_a_m2: [0.0, 0.0, -0.909],
                current_min_a: vec![0.0, -0.7, 0.0],
                current_max_a: vec![2.0, 1.3, 0.7],
                resistance_ohm: vec![6.07, 6.08, 6.09],
                total_current_max_a: Some(3.1),
                lambda_n_per_m: None,
                rendering: Some(Rendering {
                    heights: HeightGrid {
                        x_m: vec![0.1, 0.2, 0.4],
                        y_m: vec![-0.1, 0.3],
                        height_m: values(6, 0.9),
                        has_height: vec![1.0, 1.0, 0.0, 1.0, 0.0, 1.0],
                    },
                    static_current_a: vec![0.7, 0.0, 0.3],
                    inductance_h: values(9, 2.3),
                    voltage_v: Some(36.0),
                    requested: Some(Requested {
                        direction: values(18, 1.1).into_iter().map(|v| 0.5 * v).collect(),
                        sideways_weight: 0.1,
                    }),
                    robust: Some(RobustRuntime {
                        price_n2_per_w: 3e-5,
                        sensor_m: 0.004,
                        square: 0.98,
                        mean: 0.99,
                        driver_square: 1e-4,
                    }),
                }),
            },
        }
    }

    #[test]
    fn round_trip_and_same_bytes() {
        let map = sample();
        let bytes = to_npz(&map).unwrap();
        assert_eq!(bytes, to_npz(&map).unwrap());
        assert_eq!(from_npz(&bytes).unwrap(), map);
    }

    /// Local header, directory entry and content of an entry, to be put together to archives.
    fn parts_of(bytes: &[u8]) -> (Vec<u8>, Vec<Vec<u8>>) {
        let end = bytes.len() - 22;
        let at = |i: usize| u32::from_le_bytes(bytes[i..i + 4].try_into().unwrap()) as usize;
        let mut heads = Vec::new();
        let mut head = at(end + 16);
        let data = bytes[..head].to_vec();
        while head < end {
            let name = usize::from(bytes[head + 28]) + usize::from(bytes[head + 30]);
            heads.push(bytes[head..head + 46 + name].to_vec());
            head += 46 + name;
        }
        (data, heads)
    }

    /// An archive of these directory entries, its end as it must be.
    fn archive(data: &[u8], heads: &[Vec<u8>]) -> Vec<u8> {
        let (count, directory) = (heads.len() as u16, heads.concat());
        let mut bytes = [data, &directory].concat();
        bytes.extend([0x50, 0x4b, 5, 6, 0, 0, 0, 0]);
        bytes.extend([count.to_le_bytes(), count.to_le_bytes()].concat());
        bytes.extend((directory.len() as u32).to_le_bytes());
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend([0, 0]);
        bytes
    }

    #[test]
    fn an_array_that_stands_in_the_archive_twice_is_refused() {
        let bytes = to_npz(&sample()).unwrap();
        let (data, heads) = parts_of(&bytes);
        assert_eq!(archive(&data, &heads), bytes);
        for k in 0..heads.len() {
            let mut twice = heads.clone();
            twice.push(heads[k].clone());
            let message = from_npz(&archive(&data, &twice)).unwrap_err().to_string();
            assert!(message.contains("twice"), "{message}");
        }
        for (behind, at) in [(0, bytes.len()), (7, bytes.len()), (1, 0)] {
            let mut longer = bytes.clone();
            longer.splice(at..at, vec![0; behind]);
            assert_eq!(
                from_npz(&longer).is_ok(),
                behind == 0,
                "{behind} bytes at {at}"
            );
        }
    }

    #[test]
    fn every_truncation_is_an_error() {
        let bytes = to_npz(&sample()).unwrap();
        for cut in 0..bytes.len() {
            assert!(from_npz(&bytes[..cut]).is_err(), "cut at {cut}");
        }
    }

    #[test]
    fn a_changed_bit_is_an_error_or_changes_nothing() {
        let bytes = to_npz(&sample()).unwrap();
        for at in 0..bytes.len() {
            let mut edited = bytes.clone();
            edited[at] ^= 0x10;
            // Bits that only a permission or a time stamp holds may change; numbers may not.
            if let Ok(map) = from_npz(&edited) {
                assert!(map == sample(), "byte {at}");
            }
        }
    }

    #[test]
    fn wrong_content_is_named() {
        let refuse = |edit: fn(&mut MapArrays), words: &str| {
            let mut map = sample();
            edit(&mut map);
            let message = to_npz(&map).unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        };
        refuse(
            |m| m.gz_t_per_m_per_a.to_mut()[7] = f64::NAN,
            "gz_t_per_m_per_a holds a number that is not finite",
        );
        refuse(
            |m| m.passive_force_n = Some(vec![-0.7; 23].into()),
            "passive_force_n must hold 24 numbers, holds 23",
        );
        refuse(
            |m| {
                let rendering = m.runtime.rendering.as_mut().unwrap();
                rendering.heights.has_height[1] = 0.5;
            },
            "has_height must hold 0 or 1",
        );
        refuse(
            |m| {
                let rendering = m.runtime.rendering.as_mut().unwrap();
                rendering.inductance_h.pop();
            },
            "inductance_h must hold 9 numbers, holds 8",
        );
        refuse(|m| m.x_m.to_mut()[2] = 0.01, "x_m must increase");
        refuse(|m| m.z_m.to_mut()[3] = f64::INFINITY, "z_m holds");
        refuse(|m| m.coil.to_mut()[1] = 3, "below 3");
        refuse(|m| m.coil.to_mut()[1] = 0, "increasing");
        refuse(
            |m| {
                m.gz_t_per_m_per_a.to_mut().pop();
            },
            "must hold 48 numbers, holds 47",
        );
        refuse(
            |m| {
                m.runtime.resistance_ohm.pop();
            },
            "resistance_ohm must hold 3",
        );
    }
}
