//! Every command that writes, with its inputs; what each writes is found by running it.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use fluxform_testing::inputs::{AIR, BUMP};
use fluxform_testing::run::program_or_other;

/// A command that writes, and what is run before it to make its inputs.
#[derive(Clone, Copy, Debug)]
pub struct Writes {
    pub name: &'static str,
    pub before: &'static [&'static str],
    /// Words, separated by blanks.
    pub line: &'static str,
    /// Flags that make an earlier run of the same inputs leave something else, or with other options.
    pub earlier: &'static str,
    /// An input that can be spoilt, so that the command is refused.
    pub spoils: &'static str,
    /// The outputs make up one folder, which is replaced as a whole.
    pub bundle: bool,
}

const BUNDLE: &str = "calibrate air.toml bump.toml --out bundles";
const PLAN: &str = "sweep plan air.toml --set wire.diameter_mm=0.6,0.7 --out plan.json";
const POINTS: &str = "sweep run plan.json --out points";

const fn writes(name: &'static str, line: &'static str) -> Writes {
    Writes {
        name,
        before: &[],
        line,
        earlier: "",
        spoils: "air.toml",
        bundle: false,
    }
}

pub const COMMANDS: &[Writes] = &[
    Writes {
        earlier: "--no-report",
        bundle: true,
        ..writes("calibrate", "calibrate air.toml bump.toml --vtk --out out")
    },
    Writes {
        spoils: "steel.toml",
        earlier: "--criterion linear",
        bundle: true,
        ..writes(
            "calibrate (steel)",
            "calibrate steel.toml bump.toml --out out",
        )
    },
    Writes {
        spoils: "steel.toml",
        bundle: true,
        ..writes(
            "calibrate --no-cache",
            "calibrate steel.toml bump.toml --no-cache --out out",
        )
    },
    Writes {
        earlier: "--components all",
        ..writes(
            "map",
            "map air.toml --csv --vtk --vfield out/v.yaml --mpem out/m.yaml --mpem-tolerance 1e-1 --out out",
        )
    },
    writes("map --plot", "map air.toml --out out --plot out/force.svg"),
    Writes {
        earlier: "--csv --vtk",
        ..writes("map (fewer files)", "map air.toml --out out")
    },
    Writes {
        spoils: "bump.toml",
        earlier: "--certify distance",
        ..writes(
            "discretize",
            "discretize bump.toml --out out/points.csv --plot out/points.svg",
        )
    },
    writes("lambda", "lambda air.toml bump.toml --plot out/lambda.svg"),
    writes(
        "optimize",
        "optimize air.toml --out out/best.toml --report out/best.html",
    ),
    writes(
        "optimize --for",
        "optimize air.toml --for bump.toml --vary coil.inner_diameter_mm=10:30 --evaluations 12 --starts 1 --out \
         out/best.toml --front out/trade.csv --plot out/trade.svg --journal out/journal.json",
    ),
    Writes {
        earlier: "--components gz",
        ..writes("probe", "probe air.toml places.csv --out out/probe.csv")
    },
    writes(
        "probe --compare",
        "probe air.toml --compare scan.csv --fit scale --out out/residuals.csv",
    ),
    Writes {
        before: &[BUNDLE],
        spoils: "finger.csv",
        ..writes(
            "replay",
            "replay bundles/air/bump finger.csv --out out/replay.csv --plot out/replay.svg --report out/replay.html",
        )
    },
    Writes {
        before: &[BUNDLE],
        spoils: "bundles/air/bump/manifest.json",
        ..writes(
            "replay --synthesize",
            "replay bundles/air/bump --synthesize circle --duration 1 --trajectory-out out/made.csv --out out/replay.csv",
        )
    },
    writes(
        "evaluate",
        "evaluate air.toml --plot out/array.svg --plot-field out/field.svg",
    ),
    writes(
        "compare",
        "compare air.toml bump.toml knob.toml --plot out/compare.svg --plot-where out/where.svg",
    ),
    writes(
        "sweep plan",
        "sweep plan air.toml --set wire.diameter_mm=0.6,0.7 --out out/plan.json",
    ),
    Writes {
        before: &[PLAN],
        spoils: "plan.json",
        ..writes("sweep run", "sweep run plan.json --out out")
    },
    Writes {
        before: &[PLAN, POINTS],
        spoils: "plan.json",
        ..writes(
            "sweep merge",
            "sweep merge plan.json points --out out/sweep.csv --report out/sweep.html",
        )
    },
    Writes {
        spoils: "",
        ..writes("man", "man --out out")
    },
    Writes {
        spoils: "",
        ..writes("init", "init desk --out out")
    },
];

/// Measures, which take seconds: only in the whole run.
pub const MEASURES: &[Writes] = &[writes(
    "bench",
    "bench air.toml bump.toml --quick --out out",
)];

/// Lays the inputs.
pub fn lay_inputs(place: &Path) {
    let write = |name: &str, text: &str| fs::write(place.join(name), text).unwrap();
    // Many runs: two coils, few nodes and points.
    let air = AIR
        .replace("rows = 2", "rows = 1")
        .replace(", 21]", ", 7]")
        .replace("40.0", "20.0")
        .replace("[-30.0, 30.0,", "[-20.0, 20.0,");
    let bump = BUMP.replace(", 9]", ", 5]");
    let steel = air
        .replace("\"air\"", "\"steel\"")
        .replace("array = { rows = 1, columns = 2, pitch_mm = 43.0 }", CORE);
    write("air.toml", &air);
    write("steel.toml", &steel);
    write("bump.toml", &bump);
    write(
        "knob.toml",
        &bump
            .replace("bump", "knob")
            .replace("base_mm = 37", "base_mm = 39"),
    );
    write(
        "places.csv",
        "x_m,y_m,z_m\n0.007,0.003,0.04\n0.001,-0.003,0.05\n",
    );
    write(
        "finger.csv",
        "t_s,x_m,y_m,z_m\n0,0.001,0.002,0.047\n0.1,0.002,0.002,0.047\n",
    );
    let rows = [[7.0, 1.0], [-3.0, 2.0], [13.0, 1.3], [-17.0, 0.7]];
    let row = |[x, bz]: [f64; 2]| {
        let row = |coil| format!("{},0.003,0.043,{},{coil},1\n", x * 1e-3, bz * 1e-3);
        row(0) + &row(1)
    };
    let rows: String = rows.into_iter().map(row).collect();
    write(
        "scan.csv",
        &format!("x_m,y_m,z_m,bz_t,coil,current_a\n{rows}"),
    );
}

const CORE: &str = "core = { below_mm = 7.0, relative_permeability = 1300.0 }";

/// How a run ended.
#[derive(Clone, Debug)]
pub struct Ran {
    /// `None` where a signal ended it.
    pub code: Option<i32>,
    pub hangs: bool,
    pub said: String,
}

/// A run that neither ends nor uses the processor for so long waits for something.
const HANGS: Duration = Duration::from_secs(120);

/// Runs the program in `place`.
pub fn run(place: &Path, words: &[String]) -> Ran {
    let log = place.with_extension("log");
    let file = fs::File::create(&log).unwrap();
    let mut child = Command::new(program_or_other())
        .args(words)
        .current_dir(place)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(file)
        .spawn()
        .unwrap();
    let began = Instant::now();
    let mut pause = Duration::from_micros(500);
    let (code, hangs) = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break (status.code(), false);
        }
        if began.elapsed() > HANGS {
            child.kill().unwrap();
            child.wait().unwrap();
            break (None, true);
        }
        std::thread::sleep(pause);
        pause = (pause * 2).min(Duration::from_millis(20));
    };
    let said = String::from_utf8_lossy(&fs::read(&log).unwrap()).into_owned();
    fs::remove_file(&log).unwrap();
    Ran { code, hangs, said }
}

pub fn words(line: &str) -> Vec<String> {
    line.split_whitespace().map(str::to_owned).collect()
}
