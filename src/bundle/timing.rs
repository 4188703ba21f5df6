//! The seconds of a run, in files that no manifest lists: `timing.json`, `timing_replay.json`.

use serde::{Deserialize, Serialize};

use super::json::to_json;

/// Larger files hold no seconds.
pub(crate) const BYTES_MAX: u64 = 1 << 20;

/// Seconds of one stage; `timing.json` of a bundle is a list of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageSeconds {
    /// Its name.
    pub stage: String,
    /// How long it took, s.
    pub seconds: f64,
}

/// `timing_*.json` beside the table of a replay.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReplayTiming {
    /// How many positions were replayed.
    pub positions: usize,
    /// Seconds a position, where they were measured.
    pub seconds_per_step: Option<f64>,
    /// Those of the stages.
    pub stages: Vec<StageSeconds>,
}

/// Whether these are the bytes of one of the above, to the last.
#[must_use]
pub(crate) fn is_ours(bytes: &[u8]) -> bool {
    fn same<T: Serialize>(read: serde_json::Result<T>, bytes: &[u8]) -> bool {
        read.is_ok_and(|value| to_json(&value).is_ok_and(|written| written == bytes))
    }
    same(serde_json::from_slice::<Vec<StageSeconds>>(bytes), bytes)
        || same(serde_json::from_slice::<ReplayTiming>(bytes), bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_this_program_writes_is_recognised() {
        let stages = vec![StageSeconds {
            stage: "map".to_owned(),
            seconds: 0.1 + 0.2,
        }];
        let of_bundle = to_json(&stages).unwrap();
        let of_replay = to_json(&ReplayTiming {
            positions: 7,
            seconds_per_step: None,
            stages,
        });
        assert!(is_ours(&of_bundle) && is_ours(&of_replay.unwrap()));
        let edited = [&of_bundle[..], b"\n"].concat();
        let theirs: [&[u8]; 4] = [b"mine", b"{}", b"[{\"stage\": \"map\"}]", &edited];
        assert!(!theirs.into_iter().any(is_ours));
    }
}
