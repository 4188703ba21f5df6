//! A part of a job that several runs share.

use std::ops::Range;

/// The `number`-th of `of` parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: u64,
    of: u64,
}

impl Shard {
    /// Part I of N from 1, given as I/N.
    ///
    /// # Errors
    /// Anything else.
    pub fn parse(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(number, of)| {
            let (number, of) = (number.parse::<u64>().ok()?, of.parse::<u64>().ok()?);
            (1..=of).contains(&number).then_some((number, of))
        });
        match numbers {
            Some((number, of)) => Ok(Self { number, of }),
            None => Err("expected I/N, I from 1 to N, like 1/3".to_owned()),
        }
    }

    /// Which of `items` are this part's. Parts are contiguous, so that they rarely share a folder, and
    /// differ by one item at most.
    #[must_use]
    pub fn of(self, items: u64) -> Range<u64> {
        // No overflow, however many parts.
        let start = |part: u64| (u128::from(items) * u128::from(part) / u128::from(self.of)) as u64;
        start(self.number - 1)..start(self.number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_counted_from_one() {
        assert_eq!(Shard::parse("1/3"), Ok(Shard { number: 1, of: 3 }));
        assert_eq!(Shard::parse("3/3"), Ok(Shard { number: 3, of: 3 }));
        for bad in ["0/3", "4/3", "1", "1/0", "a/b", "1/3/5", "-1/3"] {
            assert!(Shard::parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn shards_are_disjoint_and_complete() {
        for items in [1u64, 7, 10, 1000, 100_000_000] {
            for of in [1u64, 2, 3, 7, 13, u64::MAX] {
                let shard = |number| Shard { number, of }.of(items);
                assert_eq!(shard(1).start, 0);
                assert_eq!(shard(of).end, items);
                for number in 1..of.min(20) {
                    let (one, two) = (shard(number), shard(number + 1));
                    assert_eq!(one.end, two.start);
                    let lengths = (one.end - one.start).abs_diff(two.end - two.start);
                    assert!(lengths <= 1);
                }
            }
        }
    }
}
