//! Reading and sampling of large STL files: CPU time of all threads, peak memory, and whether
//! the heights are right.
//!
//! ```text
//! cargo bench --locked --bench surface_speed -- [TRIANGLES | FILE.stl] [THREADS] [HEIGHTS]
//! ```
//!
//! Default: a closed wavy body of 1e6 triangles with vertical walls, whose plan is that of the
//! grid of 1001 x 1001 heights, so that the border rows stand on the walls. A file is taken in
//! millimetres and its heights are not checked; they can be written as doubles, not a number where
//! there is none. Seconds are the least of five runs, of one where
//! the file is large. The peak (Linux) is that of the process up to the line.

// A measurement: it reads the clock and prints.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use fluxform::commands::bench::clock::Watch;
use fluxform::numerics::axis::Axis;
use fluxform::progress::Silent;
use fluxform::shape::document::Placement;
use fluxform::shape::height::{Grid, Sample, heights};
use fluxform::shape::mesh::Mesh;
use fluxform::shape::placement::Transform;
use fluxform::shape::stl;
use fluxform_bench::memory::peak_bytes;

type Failure = Box<dyn Error + Send + Sync>;

/// Half the body's side and half the grid's, mm.
const HALF_MM: f64 = 50.0;
const SAMPLES: usize = 1001;
/// Files with more triangles are read once.
const SMALL: usize = 3_000_000;
/// A height may be off by this, m.
const WRONG_M: f64 = 1e-9;

/// The body: `cells` squares a side, its corners in single precision as STL keeps them.
struct Body {
    cells: usize,
}

impl Body {
    /// 2 n^2 triangles on top, 8 n of walls, 4 n below.
    fn of(triangles: usize) -> Self {
        let cells = (triangles as f64 / 2.0 + 9.0).sqrt() - 3.0;
        Self {
            cells: (cells.ceil() as usize).max(2),
        }
    }

    /// A line of the lattice, mm.
    fn line(&self, i: usize) -> f32 {
        (2.0 * HALF_MM * i as f64 / self.cells as f64 - HALF_MM) as f32
    }

    fn top(&self, i: usize, j: usize) -> [f32; 3] {
        let (x, y) = (self.line(i), self.line(j));
        let z = 40.0 + 10.0 * (0.09 * f64::from(x)).sin() * (0.07 * f64::from(y)).cos();
        [x, y, z as f32]
    }

    fn write(&self, path: &Path) -> Result<usize, Failure> {
        let n = self.cells;
        let count = 2 * n * n + 12 * n;
        let mut file = BufWriter::new(File::create(path)?);
        file.write_all(&[b' '; 80])?;
        file.write_all(&u32::try_from(count)?.to_le_bytes())?;
        let mut put = |triangle: [[f32; 3]; 3]| -> Result<(), Failure> {
            let mut record = [0u8; 50];
            for (slot, c) in record[12..48]
                .chunks_exact_mut(4)
                .zip(triangle.as_flattened())
            {
                slot.copy_from_slice(&c.to_le_bytes());
            }
            Ok(file.write_all(&record)?)
        };
        for (i, j) in (0..n * n).map(|k| (k % n, k / n)) {
            let [a, b] = [self.top(i, j), self.top(i + 1, j)];
            let [c, d] = [self.top(i, j + 1), self.top(i + 1, j + 1)];
            put([a, b, d])?;
            put([a, d, c])?;
        }
        for k in 0..n {
            for (from, to) in [
                (self.top(k, 0), self.top(k + 1, 0)),
                (self.top(n, k), self.top(n, k + 1)),
                (self.top(k + 1, n), self.top(k, n)),
                (self.top(0, k + 1), self.top(0, k)),
            ] {
                let ground = |[x, y, _]: [f32; 3]| [x, y, 0.0];
                put([ground(from), ground(to), to])?;
                put([ground(from), to, from])?;
                put([ground(to), ground(from), [0.0; 3]])?;
            }
        }
        file.flush()?;
        Ok(count)
    }

    /// Height over a point, m: of the one cell that holds it, or of the two or four that meet
    /// there, the highest.
    fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let n = self.cells;
        let cells_at = |at_mm: f64| {
            let guess = ((at_mm + HALF_MM) / (2.0 * HALF_MM) * n as f64) as usize;
            let near = guess.saturating_sub(1)..(guess + 2).min(n);
            near.filter(move |i| {
                let slack = 1e-9 * HALF_MM;
                f64::from(self.line(*i)) - slack <= at_mm
                    && at_mm <= f64::from(self.line(*i + 1)) + slack
            })
        };
        let (x, y) = (1000.0 * x_m, 1000.0 * y_m);
        let mut highest = f64::NEG_INFINITY;
        for i in cells_at(x) {
            for j in cells_at(y) {
                let z = |i, j| f64::from(self.top(i, j)[2]);
                let [x0, x1] = [i, i + 1].map(|i| f64::from(self.line(i)));
                let [y0, y1] = [j, j + 1].map(|j| f64::from(self.line(j)));
                let (u, v) = ((x - x0) / (x1 - x0), (y - y0) / (y1 - y0));
                let far = z(i + 1, j + 1);
                let height = if u >= v {
                    let side = z(i + 1, j);
                    z(i, j) + u * (side - z(i, j)) + v * (far - side)
                } else {
                    let side = z(i, j + 1);
                    z(i, j) + v * (side - z(i, j)) + u * (far - side)
                };
                highest = highest.max(height);
            }
        }
        highest / 1000.0
    }
}

/// The last value, the least CPU seconds and the least seconds of some runs.
fn timed<T>(
    runs: usize,
    mut run: impl FnMut() -> Result<T, Failure>,
) -> Result<(T, [f64; 2]), Failure> {
    let mut least = [f64::INFINITY; 2];
    let mut last = None;
    for _ in 0..runs {
        // The value of the run before is not held beside the new one.
        drop(last.take());
        let watch = Watch::start();
        last = Some(run()?);
        let took = [watch.processor_s(), watch.elapsed_s()];
        least = [0, 1].map(|k| least[k].min(took[k]));
    }
    Ok((last.ok_or("no run")?, least))
}

fn measure(
    path: &Path,
    body: Option<&Body>,
    runs: usize,
    out: Option<&str>,
) -> Result<(), Failure> {
    let side = Axis {
        from: -HALF_MM / 1000.0,
        to: HALF_MM / 1000.0,
        samples: SAMPLES,
    };
    let grid = Grid {
        x_m: side,
        y_m: side,
    };
    let print = |what: &str, [cpu, clock]: [f64; 2]| {
        println!(
            "| {what} | {cpu:.4} | {clock:.4} | {:.0} |",
            peak_bytes() as f64 / f64::from(1 << 20)
        );
    };
    println!("| step | CPU s | s | peak MiB |\n|---|---|---|---|");
    let (mesh, seconds) = timed(runs, || {
        let source = File::open(path)?;
        let length = source.metadata()?.len();
        let file = match stl::stream(source, length)? {
            Some(mesh) => mesh?,
            None => stl::read(&std::fs::read(path)?)?,
        };
        Ok(Mesh::place(
            file,
            &Transform::new(0.001, &Placement::default()),
        )?)
    })?;
    let triangles = mesh.triangles().len();
    print(&format!("read and place {triangles} triangles"), seconds);
    let (found, seconds) = timed(runs, || {
        heights(&mesh, &grid, &Silent).map_err(|error| error.to_string().into())
    })?;
    print(&format!("{SAMPLES} x {SAMPLES} heights"), seconds);
    if let Some(out) = out {
        let height = |sample: &Option<Sample>| sample.map_or(f64::NAN, |sample| sample.height_m);
        let bytes: Vec<u8> = found.iter().flat_map(|s| height(s).to_le_bytes()).collect();
        std::fs::write(out, bytes)?;
    }
    let missing = found.iter().filter(|sample| sample.is_none()).count();
    print!("\n{missing} points missing");
    if let Some(body) = body {
        let nodes = side.nodes();
        let off = found.iter().enumerate().filter_map(|(k, sample)| {
            let expected = body.height_m(nodes[k % SAMPLES], nodes[k / SAMPLES]);
            Some((sample.as_ref()?.height_m - expected).abs())
        });
        let (wrong, worst) = off.fold((0, 0.0f64), |(wrong, worst), off| {
            (wrong + usize::from(off > WRONG_M), worst.max(off))
        });
        print!(", {wrong} off by more than {WRONG_M:e} m; the worst by {worst:.1e} m");
    }
    println!();
    Ok(())
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1).filter(|a| a != "--bench");
    let what = arguments.next().unwrap_or_else(|| "1000000".into());
    let threads = arguments.next().map_or(Ok(0), |text| text.parse())?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()?;
    let out = arguments.next();
    let out = out.as_deref();
    let folder = tempfile::tempdir()?;
    if let Ok(triangles) = what.parse() {
        let body = Body::of(triangles);
        let path = folder.path().join("body.stl");
        let count = body.write(&path)?;
        measure(&path, Some(&body), if count > SMALL { 1 } else { 5 }, out)
    } else {
        measure(Path::new(&what), None, 5, out)
    }
}
