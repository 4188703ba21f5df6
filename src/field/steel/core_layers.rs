//! The layers that all cores of an array have for every drive, as sums of patterns.

use nalgebra::DMatrix;

/// Amplitudes of every pattern at every core for one drive, [pattern, core].
type OfDrive<'a> = Box<dyn Fn(usize) -> DMatrix<f64> + Sync + 'a>;

/// Layers of cores that are alike, for every drive.
pub(super) struct CoreLayers<'a> {
    cores: usize,
    drives: usize,
    /// Of every pattern side by side: [node, 1 and cosine and sine of every mode].
    on_nodes: DMatrix<f64>,
    /// Columns of a pattern.
    waves: usize,
    /// `None`: the patterns are the layers of every core for every drive, [core and drive].
    amplitudes: Option<OfDrive<'a>>,
}

impl<'a> CoreLayers<'a> {
    /// Every layer a pattern of its own: `on_nodes` as of cores for all drives, one core after the other,
    /// each of `waves` columns.
    pub(super) fn of_each(
        (cores, drives): (usize, usize),
        waves: usize,
        on_nodes: DMatrix<f64>,
    ) -> Self {
        Self {
            cores,
            drives,
            on_nodes,
            waves,
            amplitudes: None,
        }
    }

    /// Patterns of `waves` columns each, and what `of_drive` gives as their amplitudes at every core.
    pub(super) fn of_patterns(
        (cores, drives): (usize, usize),
        waves: usize,
        on_nodes: DMatrix<f64>,
        of_drive: OfDrive<'a>,
    ) -> Self {
        Self {
            cores,
            drives,
            on_nodes,
            waves,
            amplitudes: Some(of_drive),
        }
    }

    pub(super) fn cores(&self) -> usize {
        self.cores
    }

    pub(super) fn drives(&self) -> usize {
        self.drives
    }

    /// Number of patterns.
    pub(super) fn patterns(&self) -> usize {
        self.on_nodes.ncols() / self.waves
    }

    /// Number of azimuthal modes.
    pub(super) fn modes(&self) -> usize {
        self.waves.div_ceil(2)
    }

    /// All patterns side by side, [node, 1 and cosine and sine of every mode].
    pub(super) fn on_nodes(&self) -> &DMatrix<f64> {
        &self.on_nodes
    }

    /// Those of some drives where every layer is a pattern; `None` where patterns are shared.
    pub(super) fn of_some(&self, drives: &[usize]) -> Option<Self> {
        if self.amplitudes.is_some() {
            return None;
        }
        let columns: Vec<usize> = (0..self.cores)
            .flat_map(|core| drives.iter().map(move |drive| core * self.drives + drive))
            .flat_map(|pattern| pattern * self.waves..(pattern + 1) * self.waves)
            .collect();
        let on_nodes = self.on_nodes.select_columns(&columns);
        let size = (self.cores, drives.len());
        Some(Self::of_each(size, self.waves, on_nodes))
    }

    /// Of linear functions of the patterns, `[function, pattern]`, the largest magnitudes over all cores and
    /// the given drives.
    pub(super) fn largest_sums(&self, functions: &DMatrix<f64>, drives: &[usize]) -> Vec<f64> {
        let mut largest = vec![0.0_f64; functions.nrows()];
        let mut add = |sums: &DMatrix<f64>| {
            for column in sums.column_iter() {
                for (largest, sum) in largest.iter_mut().zip(column.iter()) {
                    *largest = largest.max(sum.abs());
                }
            }
        };
        match &self.amplitudes {
            None => add(functions),
            Some(of_drive) => {
                for drive in drives {
                    fluxform_base::progress::poll();
                    add(&(functions * of_drive(*drive)));
                }
            }
        }
        largest
    }

    /// The largest layer on every node over all cores and the given drives, A per ampere.
    pub(super) fn largest_on_nodes(&self, drives: &[usize]) -> Vec<f64> {
        let nodes = self.on_nodes.nrows();
        let mut largest = vec![0.0_f64; nodes];
        let mut add = |layers: &DMatrix<f64>| {
            for layers in layers.as_slice().chunks_exact(nodes) {
                for (largest, layer) in largest.iter_mut().zip(layers) {
                    *largest = largest.max(*layer);
                }
            }
        };
        let Some(of_drive) = &self.amplitudes else {
            for pattern in 0..self.patterns() {
                let waves = self.on_nodes.columns(pattern * self.waves, self.waves);
                add(&waves
                    .abs()
                    .column_sum()
                    .reshape_generic(nalgebra::Dyn(nodes), nalgebra::Dyn(1)));
            }
            return largest;
        };
        for drive in drives {
            fluxform_base::progress::poll();
            let amplitudes = of_drive(*drive);
            let mut sums = DMatrix::zeros(nodes, self.cores);
            for wave in 0..self.waves {
                // A pattern has few waves.
                let all =
                    (0..self.patterns()).map(|pattern| (pattern, pattern * self.waves + wave));
                let some = all.filter(|(_, column)| self.on_nodes.column(*column).amax() > 0.0);
                let (some, columns): (Vec<usize>, Vec<usize>) = some.unzip();
                let of_wave =
                    self.on_nodes.select_columns(&columns) * amplitudes.select_rows(&some);
                sums += of_wave.abs();
            }
            add(&sums);
        }
        largest
    }

    /// The largest amplitude of every pattern; `None` where patterns are layers themselves.
    pub(super) fn largest_amplitudes(&self) -> Option<Vec<f64>> {
        let of_drive = self.amplitudes.as_ref()?;
        let mut largest = vec![0.0_f64; self.patterns()];
        for drive in 0..self.drives {
            fluxform_base::progress::poll();
            for column in of_drive(drive).column_iter() {
                for (largest, amplitude) in largest.iter_mut().zip(column.iter()) {
                    *largest = largest.max(amplitude.abs());
                }
            }
        }
        Some(largest)
    }

    /// Linear functions of the amplitudes, `[function, pattern]`, of every core and drive: [core and
    /// function, drive]; `None` where patterns are layers themselves.
    pub(super) fn amplitudes(&self, functions: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let of_drive = self.amplitudes.as_ref()?;
        let rows = functions.nrows();
        let mut out = DMatrix::zeros(self.cores * rows, self.drives);
        for (drive, mut column) in out.column_iter_mut().enumerate() {
            fluxform_base::progress::poll();
            let of_cores = functions * of_drive(drive);
            column.copy_from_slice(of_cores.as_slice());
        }
        Some(out)
    }

    /// Linear functions of the patterns, `[function, pattern]`, as such of every core's layers: [function,
    /// drive] core by core.
    pub(super) fn of_cores(&self, functions: &DMatrix<f64>) -> Vec<DMatrix<f64>> {
        let Some(of_drive) = &self.amplitudes else {
            let of_core = |core| {
                functions
                    .columns(core * self.drives, self.drives)
                    .into_owned()
            };
            return (0..self.cores).map(of_core).collect();
        };
        let of_drives: Vec<DMatrix<f64>> = (0..self.drives)
            .map(|drive| functions * of_drive(drive))
            .collect();
        let of_core = |core| {
            let columns: Vec<_> = of_drives.iter().map(|all| all.column(core)).collect();
            DMatrix::from_columns(&columns)
        };
        (0..self.cores).map(of_core).collect()
    }
}
