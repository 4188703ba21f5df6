//! The most memory that this process held, as the system reports it.

/// The peak of the resident memory (`VmHWM`), bytes; 0 where there is no `/proc`.
#[must_use]
pub fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kibibytes = line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
    kibibytes.unwrap_or(0) * 1024
}

#[cfg(test)]
mod tests {
    use super::peak_bytes;

    #[test]
    #[cfg(target_os = "linux")]
    fn a_large_block_raises_the_peak() {
        let before = peak_bytes();
        let block = vec![1_u8; 64 << 20];
        assert!(std::hint::black_box(&block).iter().all(|b| *b == 1));
        assert!(peak_bytes() >= before.max(64 << 20));
    }
}
