//! The typed values of a section: numbers, lists, axes, texts, choices.

use fluxform_base::choice::Choice;
use fluxform_base::length_unit::{parse_unit, unit_names};
use toml::Spanned;
use toml::de::DeValue;

use super::diagnostics::Fault;
use super::gauge::awg_mm;
use super::key::{Accepts, Without};
use super::message_text::{axis_fault, nearest, number, quoted};
use super::reader::{Located, Section, ValueRef};
use super::rule::{Bound, Rule};
use fluxform_numerics::axis::Axis;

/// Longest name of a document, bytes.
const NAME_MAX: usize = 100;

/// The name of a document that is made of the one called `name`: `name` and `suffix`, of which `name` is cut where
/// both would be longer than a name may be.
#[must_use]
pub fn derived_name(name: &str, suffix: &str) -> String {
    let most = NAME_MAX.saturating_sub(suffix.len());
    format!("{}{suffix}", &name[..name.floor_char_boundary(most)])
}

/// Largest count, far above what any bound on a product of counts admits.
const COUNT_MAX: f64 = 1e9;

/// Most values in one list.
const LIST_MAX: usize = 1_000_000;

/// One number for all, or one for each.
#[derive(Debug, Clone, PartialEq)]
pub enum OneOrMany {
    /// The same for all.
    One(f64),
    /// One for each.
    Many(Vec<f64>),
}

/// Whether a text can name a design or a shape, and with it a folder: `[A-Za-z0-9._-]+`.
///
/// # Errors
/// What is expected.
pub fn check_name(name: &str) -> Result<(), String> {
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    let fits = (1..=NAME_MAX).contains(&name.len()) && name.chars().all(plain);
    if fits && name != "." && name != ".." {
        return Ok(());
    }
    Err(format!(
        "expected 1 to {NAME_MAX} of A-Z a-z 0-9 . _ -, found {}",
        quoted(name)
    ))
}

impl<'a> Section<'a> {
    /// A number; `None` where absent, NaN where at fault.
    pub fn number(&mut self, key: &'static str, rule: &Rule) -> Option<Located<f64>> {
        self.list(key, || of_rule("number", rule), || Without::Nothing);
        let found = self.found(key)?;
        let value = self.checked(&self.path_of(key), found, rule);
        self.warn_of_slip(key, &[value], rule, found);
        Some(located(value, found))
    }

    /// The number of a key that is not a key of the document, but which somebody may write; NaN where
    /// it holds something else.
    pub(super) fn unlisted(&mut self, key: &'static str) -> Option<f64> {
        self.has(key).then(|| {
            self.found(key)
                .and_then(|found| float(found.get_ref()))
                .unwrap_or(f64::NAN)
        })
    }

    /// A number with a default.
    pub fn number_or(&mut self, key: &'static str, rule: &Rule, default: f64) -> Located<f64> {
        let without = || Without::Value(number(default));
        self.list(key, || of_rule("number", rule), without);
        self.number(key, rule).unwrap_or_else(|| {
            self.assume(key, number(default));
            Located {
                value: default,
                span: self.span(),
            }
        })
    }

    /// A number that must be given.
    pub fn required(&mut self, key: &'static str, rule: &Rule) -> Located<f64> {
        self.list(key, || of_rule("number", rule), || Without::Refused);
        self.number(key, rule).unwrap_or_else(|| {
            let unit = if rule.unit.is_empty() {
                "a number"
            } else {
                rule.unit
            };
            self.missing(key, &format!("add {key} = ... ({unit}) to [{}]", self.path));
            Located {
                value: f64::NAN,
                span: self.span(),
            }
        })
    }

    /// A list of numbers, at least one; `None` where absent, empty where at fault.
    pub fn numbers(&mut self, key: &'static str, rule: &Rule) -> Option<Located<Vec<f64>>> {
        self.list(
            key,
            || of_rule("list of numbers", rule),
            || Without::Nothing,
        );
        let found = self.found(key)?;
        let items = self.items(key, found, "a list of numbers");
        let values = self.checked_items(key, items, rule);
        self.warn_of_slip(key, &values, rule, found);
        Some(located(values, found))
    }

    /// Whether each item of a list is a text.
    pub fn texts_among(&mut self, key: &'static str) -> Vec<bool> {
        match self.found(key).map(Spanned::get_ref) {
            Some(DeValue::Array(items)) => {
                let is_text =
                    |item: &Spanned<DeValue>| matches!(item.get_ref(), DeValue::String(_));
                items.iter().map(is_text).collect()
            }
            _ => Vec::new(),
        }
    }

    /// One number, or a list of numbers, with a default; an empty list where at fault.
    pub fn one_or_many(
        &mut self,
        key: &'static str,
        rule: &Rule,
        default: f64,
    ) -> Located<OneOrMany> {
        let value = || of_rule("number or list of numbers", rule);
        self.list(key, value, || Without::Value(number(default)));
        let given = self.found(key).and_then(|found| {
            let value = match found.get_ref() {
                DeValue::Array(_) => OneOrMany::Many(self.numbers(key, rule)?.value),
                _ => OneOrMany::One(self.number(key, rule)?.value),
            };
            Some(located(value, found))
        });
        if !self.has(key) {
            self.assume(key, number(default));
        }
        given.unwrap_or(Located {
            value: OneOrMany::One(default),
            span: self.span(),
        })
    }

    /// Exactly `N` numbers, zeros where absent; NaN where at fault.
    pub fn tuple<const N: usize>(&mut self, key: &'static str, rule: &Rule) -> [f64; N] {
        let zeros = || Without::Value(format!("[{}]", ["0"; N].join(", ")));
        self.list(key, || of_tuple(N, rule), zeros);
        self.tuple_if_given(key, rule).unwrap_or([0.0; N])
    }

    /// Exactly `N` numbers; `None` where absent, NaN where at fault.
    pub fn tuple_if_given<const N: usize>(
        &mut self,
        key: &'static str,
        rule: &Rule,
    ) -> Option<[f64; N]> {
        self.list(key, || of_tuple(N, rule), || Without::Nothing);
        let found = self.found(key)?;
        let mut values = [f64::NAN; N];
        let expected = format!("a list of {N} numbers");
        let items = self.items(key, found, &expected);
        if items.len() == N {
            values.copy_from_slice(&self.checked_items(key, items, rule));
            self.warn_of_slip(key, &values, rule, found);
        } else if !items.is_empty() {
            let message = format!("expected {expected}, found {}", items.len());
            self.fault(key, message, "write them in square brackets, with commas");
        }
        Some(values)
    }

    /// A list of at most `most` pairs `[a, b]`, each with its place; empty where at fault.
    pub fn pairs(
        &mut self,
        key: &'static str,
        rule: &Rule,
        most: usize,
    ) -> Option<Vec<Located<[f64; 2]>>> {
        self.tuples(key, rule, most, ["pair", "[x, y]"])
    }

    /// A list of at most `most` tuples of `N` numbers, each with its place; empty where at fault. `named`: what
    /// one is, and its parts.
    pub fn tuples<const N: usize>(
        &mut self,
        key: &'static str,
        rule: &Rule,
        most: usize,
        [one, parts]: [&str; 2],
    ) -> Option<Vec<Located<[f64; N]>>> {
        let kind = format!("list of {one}s {parts}");
        self.list(key, || of_rule(&kind, rule), || Without::Nothing);
        let found = self.found(key)?;
        let items = self.items(key, found, &format!("a {kind}"));
        if items.len() > most {
            let message = format!("{} {one}s are more than {most}", items.len());
            self.fault(key, message, "shorten the list");
            return Some(Vec::new());
        }
        let expected = format!("a {one} {parts}");
        let tuples: Option<Vec<_>> = (0..)
            .zip(items)
            .map(|(i, item)| self.one_tuple(key, i, item, rule, &expected))
            .collect();
        let tuples = tuples.unwrap_or_default();
        let values: Vec<f64> = tuples.iter().flat_map(|tuple| tuple.value).collect();
        self.warn_of_slip(key, &values, rule, found);
        Some(tuples)
    }

    fn one_tuple<const N: usize>(
        &self,
        key: &str,
        index: usize,
        item: ValueRef<'a>,
        rule: &Rule,
        expected: &str,
    ) -> Option<Located<[f64; N]>> {
        let path = format!("{}[{index}]", self.path_of(key));
        let DeValue::Array(parts) = item.get_ref() else {
            self.add_wrong_type(&path, item, expected);
            return None;
        };
        if parts.len() != N {
            let message = format!("expected {expected}, found {} values", parts.len());
            self.sink.add(Fault::error(path, message).at(&item.span()));
            return None;
        }
        let values = std::array::from_fn(|i| self.checked(&path, &parts[i], rule));
        values
            .iter()
            .all(|v| v.is_finite())
            .then(|| located(values, item))
    }

    /// A whole number of at least 1 with a default; `None` where at fault.
    pub(crate) fn count_or(&mut self, key: &'static str, default: usize) -> Option<usize> {
        let value = || Accepts {
            range: ">= 1".to_owned(),
            ..Accepts::any("whole number")
        };
        self.list(key, value, || Without::Value(default.to_string()));
        match self.found(key) {
            Some(found) => self.whole(&self.path_of(key), found),
            None => {
                self.assume(key, default.to_string());
                Some(default)
            }
        }
    }

    /// An axis `[from, to, samples]` with a default; `None` where at fault.
    pub fn axis_or(
        &mut self,
        key: &'static str,
        rule: &Rule,
        default: Axis,
    ) -> Option<Located<Axis>> {
        let shown = || {
            let ends = [default.from, default.to].map(number).join(", ");
            format!("[{ends}, {}]", default.samples)
        };
        let without = || Without::Value(shown());
        self.list(key, || of_rule("[from, to, samples]", rule), without);
        match self.found(key) {
            Some(found) => self.axis_in(key, found, rule),
            None => {
                self.assume(key, shown());
                Some(Located {
                    value: default,
                    span: self.span(),
                })
            }
        }
    }

    fn axis_in(&self, key: &str, found: ValueRef<'a>, rule: &Rule) -> Option<Located<Axis>> {
        let items = self.items(key, found, "[from, to, samples]");
        let [from, to, samples] = items else {
            if !items.is_empty() {
                let message = format!("expected [from, to, samples], found {} values", items.len());
                self.fault(key, message, "for example [-50.0, 50.0, 61]");
            }
            return None;
        };
        let path = self.path_of(key);
        let ends = [
            self.checked(&path, from, rule),
            self.checked(&path, to, rule),
        ];
        let samples = self.whole(&format!("{path} (samples)"), samples)?;
        let axis = Axis {
            from: ends[0],
            to: ends[1],
            samples,
        };
        if ends.iter().any(|end| end.is_nan()) {
            return None;
        }
        if let Some((message, help)) = axis_fault(&axis, rule.unit) {
            self.fault(key, message, help);
            return None;
        }
        self.warn_of_slip(key, &ends, rule, found);
        Some(located(axis, found))
    }

    /// A text; `None` where absent or at fault.
    pub fn text(&mut self, key: &'static str) -> Option<Located<String>> {
        self.list(key, || Accepts::any("text"), || Without::Nothing);
        let found = self.found(key)?;
        match found.get_ref() {
            DeValue::String(text) => Some(located(text.to_string(), found)),
            _ => {
                self.add_wrong_type(&self.path_of(key), found, "a text in quotes");
                None
            }
        }
    }

    /// A unit of length, m; `None` where absent or at fault.
    pub fn length_unit(&mut self, key: &'static str) -> Option<f64> {
        let unit = self.text(key)?.value;
        let metres = parse_unit(&unit);
        if metres.is_none() {
            let names = unit_names();
            let message = format!("expected {}, found {}", names.join(", "), quoted(&unit));
            let help = nearest(&unit, &names).map(|near| format!("did you mean {near:?}?"));
            self.fault(
                key,
                message,
                help.as_deref()
                    .unwrap_or("name the unit of the file's coordinates"),
            );
        }
        metres
    }

    /// A required text; `None` where absent or at fault.
    pub(crate) fn required_text(
        &mut self,
        key: &'static str,
        help: &str,
    ) -> Option<Located<String>> {
        self.list(key, || Accepts::any("text"), || Without::Refused);
        if !self.has(key) {
            self.missing(key, help);
        }
        self.text(key)
    }

    /// The document's required `name`: `[A-Za-z0-9._-]+`, because it names a folder.
    pub fn name(&mut self) -> Option<String> {
        let name = self
            .required_text("name", "add name = \"...\"; it names the output folder")?
            .value;
        match check_name(&name) {
            Ok(()) => Some(name),
            Err(message) => {
                self.fault("name", message, "it names the output folder");
                None
            }
        }
    }

    /// A variant of `T` by name, the first where absent or at fault.
    pub fn choice_or_first<T: Choice>(&mut self, key: &'static str) -> T {
        let first = T::VARIANTS[0];
        let name: &str = first.into();
        self.list(
            key,
            || Accepts::any(choices::<T>()),
            || Without::Value(format!("{name:?}")),
        );
        if !self.has(key) {
            self.assume(key, format!("{name:?}"));
        }
        self.choice(key).unwrap_or(first)
    }

    /// A variant of `T` by name; `None` where absent or at fault.
    pub fn choice<T: Choice>(&mut self, key: &'static str) -> Option<T> {
        self.list(key, || Accepts::any(choices::<T>()), || Without::Nothing);
        let text = self.text(key)?;
        if let Ok(value) = text.value.parse() {
            return Some(value);
        }
        let names: Vec<&str> = T::VARIANTS.iter().map(|&one| one.into()).collect();
        let listed: Vec<String> = names.iter().map(|name| format!("{name:?}")).collect();
        let message = format!(
            "expected {}, found {}",
            listed.join(" or "),
            quoted(&text.value)
        );
        let help = nearest(&text.value, &names).map(|name| format!("did you mean {name:?}?"));
        self.fault(
            key,
            message,
            help.as_deref().unwrap_or("choose one of them"),
        );
        None
    }

    /// Variants of `T` by name, each once; empty where absent or at fault.
    pub fn choices<T: Choice + PartialEq>(&mut self, key: &'static str) -> Vec<T> {
        let value = || Accepts::any(format!("list of {}", choices::<T>()));
        self.list(key, value, || Without::Nothing);
        let Some(found) = self.found(key) else {
            return Vec::new();
        };
        let mut chosen = Vec::new();
        for item in self.items(key, found, "a list of names") {
            let DeValue::String(text) = item.get_ref() else {
                self.add_wrong_type(&self.path_of(key), item, "a name in quotes");
                continue;
            };
            match text.parse::<T>() {
                Ok(value) if !chosen.contains(&value) => chosen.push(value),
                Ok(_) => self.fault(
                    key,
                    format!("{text:?} is there twice"),
                    "give each name once",
                ),
                Err(_) => {
                    let message = format!("expected {}, found {}", choices::<T>(), quoted(text));
                    self.fault(key, message, "choose among them");
                }
            }
        }
        chosen
    }

    /// True or false; the default where absent or at fault.
    pub fn flag_or(&mut self, key: &'static str, default: bool) -> bool {
        let value = || Accepts::any("true or false");
        self.list(key, value, || Without::Value(default.to_string()));
        match self.found(key).map(|found| (found, found.get_ref())) {
            None => default,
            Some((_, DeValue::Boolean(value))) => *value,
            Some((found, _)) => {
                self.add_wrong_type(&self.path_of(key), found, "true or false");
                default
            }
        }
    }

    fn items(&self, key: &str, found: ValueRef<'a>, expected: &str) -> &'a [Spanned<DeValue<'a>>] {
        match found.get_ref() {
            DeValue::Array(items) if items.is_empty() => {
                self.fault(
                    key,
                    format!("expected {expected}, found an empty list"),
                    "leave the key out for its default",
                );
            }
            DeValue::Array(items) if items.len() > LIST_MAX => {
                self.fault(
                    key,
                    format!("{} values are more than {LIST_MAX}", items.len()),
                    "shorten the list",
                );
            }
            DeValue::Array(items) => return items,
            _ => self.add_wrong_type(&self.path_of(key), found, expected),
        }
        &[]
    }

    fn checked_items(&self, key: &str, items: &'a [Spanned<DeValue<'a>>], rule: &Rule) -> Vec<f64> {
        let path = self.path_of(key);
        let value = |(i, item)| self.checked(&format!("{path}[{i}]"), item, rule);
        items.iter().enumerate().map(value).collect()
    }

    /// The number, or NaN and a fault.
    fn checked(&self, path: &str, found: ValueRef<'a>, rule: &Rule) -> f64 {
        let value = match found.get_ref() {
            DeValue::String(text) if rule.gauges => awg_mm(text),
            other => float(other),
        };
        let Some(value) = value else {
            let expected = if rule.gauges {
                "a number or a gauge like \"AWG 22\", from 4/0 to 56"
            } else {
                "a number"
            };
            let message = format!("expected {expected}, found {}", described(found.get_ref()));
            let fault = Fault::error(path, message).at(&found.span());
            self.sink
                .add(match quoted_number(found.get_ref(), rule.unit) {
                    Some(help) => fault.help(help),
                    None => fault,
                });
            return f64::NAN;
        };
        match rule.error(path, value, &found.span()) {
            None => value,
            Some(fault) => {
                self.sink.add(fault);
                f64::NAN
            }
        }
    }

    fn whole(&self, path: &str, found: ValueRef<'a>) -> Option<usize> {
        let rule = Rule::any("").bound(Bound::AtLeast(1.0));
        let value = self.checked(path, found, &rule);
        if value.fract() == 0.0 && value <= COUNT_MAX {
            return Some(value as usize);
        }
        if value.is_finite() {
            let found_value = number(value);
            let message =
                format!("expected a whole number up to {COUNT_MAX:e}, found {found_value}");
            self.sink.add(Fault::error(path, message).at(&found.span()));
        }
        None
    }

    /// Warns of the largest of `values`: a list in another unit is one slip.
    fn warn_of_slip(&self, key: &str, values: &[f64], rule: &Rule, found: ValueRef<'a>) {
        let largest = values
            .iter()
            .copied()
            .fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
        if let Some(fault) = rule.warning(&self.path_of(key), largest, &found.span()) {
            self.sink.add(fault);
        }
    }

    pub(super) fn add_wrong_type(&self, path: &str, found: ValueRef<'a>, expected: &str) {
        let message = format!("expected {expected}, found {}", described(found.get_ref()));
        self.sink.add(Fault::error(path, message).at(&found.span()));
    }
}

/// The values of this kind that a rule accepts.
fn of_rule(kind: &str, rule: &Rule) -> Accepts {
    Accepts {
        kind: kind.to_owned(),
        unit: rule.unit,
        gauges: rule.gauges,
        range: rule.bound.symbols(),
    }
}

fn of_tuple(count: usize, rule: &Rule) -> Accepts {
    of_rule(&format!("{count} numbers"), rule)
}

fn choices<T: Choice>() -> String {
    let names = T::VARIANTS.iter().map(|&one| -> &str { one.into() });
    let names: Vec<String> = names.map(|name| format!("`{name:?}`")).collect();
    names.join(" or ")
}

fn located<T>(value: T, found: ValueRef<'_>) -> Located<T> {
    Located {
        value,
        span: found.span(),
    }
}

fn float(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().parse().ok(),
        DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse().ok(),
        DeValue::Integer(integer) => {
            let value = i128::from_str_radix(integer.as_str(), integer.radix());
            // Only a hexadecimal, octal or binary number of over 127 bits fails.
            Some(value.map_or(f64::INFINITY, |v| v as f64))
        }
        _ => None,
    }
}

/// Advice for a number that was written as a text: `"40 mm"`.
fn quoted_number(value: &DeValue<'_>, unit: &str) -> Option<String> {
    let DeValue::String(text) = value else {
        return None;
    };
    let text = text.trim().replacen(',', ".", 1);
    let end = text.find(|c: char| c.is_alphabetic() && !matches!(c, 'e' | 'E'));
    let (digits, given) = text.split_at(end.unwrap_or(text.len()));
    let value: f64 = digits.trim().parse().ok()?;
    if given.is_empty() || given.trim() == unit {
        return Some(format!("write {} without quotes and unit", number(value)));
    }
    let unit = if unit.is_empty() { "no unit" } else { unit };
    Some(format!(
        "write a number without quotes: the key's name holds its unit, {unit}"
    ))
}

fn described(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("the text {}", quoted(text)),
        DeValue::Integer(_) | DeValue::Float(_) => {
            format!(
                "the number {}",
                float(value).map_or_else(String::new, number)
            )
        }
        DeValue::Boolean(value) => format!("{value}"),
        DeValue::Datetime(_) => "a date or time".to_owned(),
        DeValue::Array(items) => format!("a list of {}", items.len()),
        DeValue::Table(_) => "a section".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_derived_name_is_one_of_a_document() {
        assert_eq!(derived_name("seed", "_optimum"), "seed_optimum");
        for length in [NAME_MAX - 8, NAME_MAX - 7, NAME_MAX] {
            let name = derived_name(&"a".repeat(length), "_optimum");
            assert_eq!(name.len(), NAME_MAX);
            assert!(name.ends_with("a_optimum"), "{name}");
        }
        // No character is cut in two.
        assert_eq!(derived_name(&"\u{e9}".repeat(60), "_array").len(), 100);
        assert_eq!(derived_name(&"\u{e9}".repeat(60), "_arrays").len(), 99);
    }
}
