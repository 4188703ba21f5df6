//! Headers of NPY 1.0 arrays: little-endian, C order, f64 or i64.
//!
//! The grammar that is read is the one numpy writes, nothing more: an untrusted header must not
//! get a Python parser to play with. All loaders accept the same headers: spaces aside where they part
//! no number, and a line feed at the end.

/// The first bytes of an NPY 1.0 file; two bytes of header length follow.
const MAGIC: &[u8; 8] = b"\x93NUMPY\x01\x00";

/// Size of an element, f64 or i64.
pub(super) const ELEMENT_BYTES: usize = 8;

/// The header of an array, padded as numpy pads it: data begin at a multiple of 64 bytes.
pub(super) fn header(kind: &str, shape: &[usize]) -> Vec<u8> {
    let mut dimensions = String::new();
    for (i, size) in shape.iter().enumerate() {
        if i > 0 {
            dimensions.push_str(", ");
        }
        dimensions.push_str(&size.to_string());
    }
    if shape.len() == 1 {
        dimensions.push(',');
    }
    let text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({dimensions}), }}");
    let before = MAGIC.len() + 2;
    let length = (before + text.len() + 1).next_multiple_of(64) - before;
    let mut header = MAGIC.to_vec();
    // At most a few hundred bytes: shapes have at most six dimensions.
    header.extend_from_slice(&(length as u16).to_le_bytes());
    header.extend_from_slice(text.as_bytes());
    header.resize(before + length - 1, b' ');
    header.push(b'\n');
    header
}

/// Shape and data of an array of `kind` in an NPY file; the data are as long as the shape says.
pub(super) fn parse<'a>(file: &'a [u8], kind: &str) -> Result<(Vec<usize>, &'a [u8]), String> {
    let rest = file
        .strip_prefix(MAGIC.as_slice())
        .ok_or("is not an NPY 1.0 array")?;
    let (length, rest) = rest
        .split_first_chunk::<2>()
        .ok_or("ends within its header")?;
    let length = usize::from(u16::from_le_bytes(*length));
    let (text, data) = rest
        .split_at_checked(length)
        .ok_or("ends within its header")?;
    let text = without_blanks(text.strip_suffix(b"\n").unwrap_or(text));
    let shape = text
        .strip_prefix(&format!(
            "{{'descr':'{kind}','fortran_order':False,'shape':("
        ))
        .and_then(|rest| rest.strip_suffix(",}").or(rest.strip_suffix('}')))
        .and_then(|rest| rest.strip_suffix(')'))
        .ok_or_else(|| {
            let shown: String = text
                .chars()
                .take(80)
                .filter(char::is_ascii_graphic)
                .collect();
            format!("must hold '{kind}' in C order, its header says {shown}")
        })?;
    let shape: Vec<usize> = shape
        .split_terminator(',')
        .map(|size| {
            let digits = size.bytes().all(|byte| byte.is_ascii_digit());
            let number = digits.then(|| size.parse().ok()).flatten();
            number.ok_or_else(|| format!("has a bad dimension {size:?}"))
        })
        .collect::<Result<_, _>>()?;
    let elements = shape
        .iter()
        .try_fold(ELEMENT_BYTES as u64, |product, &size| {
            product.checked_mul(size as u64)
        });
    if elements != Some(data.len() as u64) {
        return Err(format!(
            "says its shape is {shape:?}, but holds {} bytes of data",
            data.len()
        ));
    }
    Ok((shape, data))
}

/// The characters of a header without its spaces; one stays between two digits, which are no number together.
fn without_blanks(text: &[u8]) -> String {
    let mut left = String::new();
    let mut blank = false;
    for &byte in text {
        if byte == b' ' {
            blank = true;
            continue;
        }
        if blank && byte.is_ascii_digit() && left.ends_with(|c: char| c.is_ascii_digit()) {
            left.push(' ');
        }
        left.push(char::from(byte));
        blank = false;
    }
    left
}

#[cfg(test)]
mod tests {
    use super::{header, parse};

    #[test]
    fn headers_are_what_numpy_writes() {
        let one = header("<f8", &[61]);
        assert_eq!(one.len(), 128);
        assert_eq!(&one[..10], b"\x93NUMPY\x01\x00\x76\x00");
        assert!(
            one[10..].starts_with(b"{'descr': '<f8', 'fortran_order': False, 'shape': (61,), }  ")
        );
        assert_eq!(one[127], b'\n');
        assert!(
            header("<i8", &[])
                .windows(14)
                .any(|w| w == b"'shape': (), }")
        );
        assert!(
            header("<f8", &[3, 2])
                .windows(18)
                .any(|w| w == b"'shape': (3, 2), }")
        );
    }

    #[test]
    fn reads_its_own_and_refuses_the_rest() {
        for shape in [vec![], vec![7], vec![2, 3, 5, 7, 3, 3]] {
            let mut file = header("<f8", &shape);
            let head = file.len();
            file.resize(head + 8 * shape.iter().product::<usize>(), 7);
            assert_eq!(parse(&file, "<f8"), Ok((shape.clone(), &file[head..])));
            assert!(parse(&file, "<i8").is_err());
            for cut in 0..file.len() {
                assert!(parse(&file[..cut], "<f8").is_err());
            }
            file.extend([0; 8]);
            assert!(parse(&file, "<f8").is_err());
        }
        let replace = |from: &str, to: &str| {
            let text = String::from_utf8_lossy(&header("<f8", &[3, 2])[10..]).replace(from, to);
            let mut file = b"\x93NUMPY\x01\x00".to_vec();
            file.extend_from_slice(&(text.len() as u16).to_le_bytes());
            file.extend_from_slice(text.as_bytes());
            file
        };
        for (from, to) in [
            ("(3, 2)", "(4294967296, 4294967296)"),
            ("(3, 2)", "(-3, -2)"),
            ("(3, 2)", "(3, 2"),
            ("(3, 2)", "((3, 2))"),
            ("False", "True"),
            ("<f8", "|O"),
            ("<f8", ">f8"),
        ] {
            let mut file = replace(from, to);
            file.extend([0; 48]);
            assert!(parse(&file, "<f8").is_err(), "{from} -> {to}");
        }
    }
}
