//! Lines along a field of directions in a plane, as far apart as requested.
//!
//! After B. Jobard and W. Lefer, Creating evenly-spaced streamlines of arbitrary density, Visualization
//! in Scientific Computing '97: a line is followed until it meets another one or its own beginning, and the
//! next one starts beside it.

use std::collections::{HashMap, VecDeque};

/// Step along a line, in parts of the distance between lines.
const STEP: f64 = 0.15;
/// A line ends where another is closer than this part of the distance between lines.
const CLOSEST: f64 = 0.5;
/// Shorter lines than this many distances are left out.
const SHORTEST: f64 = 2.0;
/// Steps of a line in one direction, at most.
const MOST_STEPS: usize = 4000;

/// Vectors in the middle of equal cells; between them bilinear.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneField {
    /// Ends of the plane along both axes.
    pub ends: [[f64; 2]; 2],
    /// Cells along the first axis, which is fastest.
    pub columns: usize,
    /// One vector a cell; `None` where lines end.
    pub vectors: Vec<Option<[f64; 2]>>,
}

impl PlaneField {
    fn rows(&self) -> usize {
        self.vectors.len() / self.columns.max(1)
    }

    /// The unit vector at a place; `None` outside, beside a cell without a vector, and where there is no
    /// direction.
    fn direction(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let counts = [self.columns, self.rows()];
        let mut cells = [(0, 0, 0.0); 2];
        for axis in 0..2 {
            let [from, to] = self.ends[axis];
            let share = (place[axis] - from) / (to - from);
            if !(0.0..=1.0).contains(&share) {
                return None;
            }
            let last = counts[axis].checked_sub(1)?;
            let at = (share * counts[axis] as f64 - 0.5).clamp(0.0, last as f64);
            let low = (at as usize).min(last);
            cells[axis] = (low, (low + 1).min(last), at - low as f64);
        }
        let [(left, right, u), (low, high, v)] = cells;
        let cell = |column: usize, row: usize| self.vectors[row * self.columns + column];
        let corners = [
            (cell(left, low)?, (1.0 - u) * (1.0 - v)),
            (cell(right, low)?, u * (1.0 - v)),
            (cell(left, high)?, (1.0 - u) * v),
            (cell(right, high)?, u * v),
        ];
        let mut sum = [0.0; 2];
        for (vector, weight) in corners {
            sum[0] += weight * vector[0];
            sum[1] += weight * vector[1];
        }
        let size = sum[0].hypot(sum[1]);
        (size > 0.0).then(|| sum.map(|part| part / size))
    }

    /// Lines that fill the plane, `distance` apart, each in the field's direction.
    #[must_use]
    pub fn streamlines(&self, distance: f64) -> Vec<Vec<[f64; 2]>> {
        let mut drawn = Drawn::new(distance);
        let mut lines: Vec<Vec<[f64; 2]>> = Vec::new();
        let mut beside: VecDeque<usize> = VecDeque::new();
        for seed in self.grid(distance) {
            if let Some(line) = self.line(seed, &mut drawn) {
                beside.push_back(lines.len());
                lines.push(line);
            }
            while let Some(at) = beside.pop_front() {
                for seed in self.seeds_beside(&lines[at], distance) {
                    if let Some(line) = self.line(seed, &mut drawn) {
                        beside.push_back(lines.len());
                        lines.push(line);
                    }
                }
            }
        }
        lines
    }

    /// Places all over the plane, in order.
    fn grid(&self, distance: f64) -> Vec<[f64; 2]> {
        let counts = self
            .ends
            .map(|[from, to]| ((to - from) / distance).ceil().max(1.0) as usize);
        let at = |axis: usize, k: usize| {
            let [from, to] = self.ends[axis];
            from + (to - from) * (k as f64 + 0.5) / counts[axis] as f64
        };
        let rows = 0..counts[1];
        rows.flat_map(|j| (0..counts[0]).map(move |i| [at(0, i), at(1, j)]))
            .collect()
    }

    /// Places at the distance of lines on both sides of one.
    fn seeds_beside(&self, line: &[[f64; 2]], distance: f64) -> Vec<[f64; 2]> {
        let every = (1.0 / STEP).ceil() as usize;
        let places = line.iter().step_by(every).filter_map(|place| {
            let [x, y] = *place;
            let [u, v] = self.direction(*place)?;
            Some([1.0, -1.0].map(|side| [x - side * distance * v, y + side * distance * u]))
        });
        places.flatten().collect()
    }

    /// The line through a place, unless another is too close or it is too short.
    fn line(&self, seed: [f64; 2], drawn: &mut Drawn) -> Option<Vec<[f64; 2]>> {
        if !drawn.is_free(seed, 0.999) {
            return None;
        }
        self.direction(seed)?;
        let forwards = self.follow(seed, 1.0, drawn, None);
        let closed = forwards.closed;
        let mut line: Vec<[f64; 2]> = Vec::new();
        if !closed {
            let mut backwards = self
                .follow(seed, -1.0, drawn, Some(&forwards.places))
                .places;
            backwards.reverse();
            line = backwards;
        }
        line.push(seed);
        line.extend(forwards.places);
        if closed {
            line.push(seed);
        }
        let steps = SHORTEST / STEP;
        if (line.len() as f64) < steps {
            return None;
        }
        drawn.add(&line);
        Some(line)
    }

    /// The places after `seed`, along the field or against it, by the classical rule of Runge and Kutta.
    fn follow(
        &self,
        seed: [f64; 2],
        sign: f64,
        drawn: &Drawn,
        other: Option<&[[f64; 2]]>,
    ) -> Followed {
        let step = STEP * drawn.distance;
        let moved = |[x, y]: [f64; 2], [u, v]: [f64; 2], by: f64| [x + by * u, y + by * v];
        let mut places = Vec::new();
        let mut place = seed;
        for _ in 0..MOST_STEPS {
            let next = (|| {
                let by = sign * step;
                let a = self.direction(place)?;
                let b = self.direction(moved(place, a, 0.5 * by))?;
                let c = self.direction(moved(place, b, 0.5 * by))?;
                let d = self.direction(moved(place, c, by))?;
                let mean = [0, 1].map(|k| (a[k] + 2.0 * (b[k] + c[k]) + d[k]) / 6.0);
                Some(moved(place, mean, by))
            })();
            let Some(next) = next.filter(|next| drawn.is_free(*next, CLOSEST)) else {
                break;
            };
            let near = |[x, y]: [f64; 2]| (x - next[0]).hypot(y - next[1]);
            // Back where it began: closed.
            if places.len() > 8 && near(seed) < step {
                return Followed {
                    places,
                    closed: true,
                };
            }
            if other.is_some_and(|other| other.iter().skip(8).any(|at| near(*at) < step)) {
                break;
            }
            places.push(next);
            place = next;
        }
        Followed {
            places,
            closed: false,
        }
    }
}

struct Followed {
    places: Vec<[f64; 2]>,
    closed: bool,
}

/// The places of lines, by squares as wide as lines are apart.
struct Drawn {
    distance: f64,
    squares: HashMap<[i64; 2], Vec<[f64; 2]>>,
}

impl Drawn {
    fn new(distance: f64) -> Self {
        Self {
            distance,
            squares: HashMap::new(),
        }
    }

    fn square(&self, place: [f64; 2]) -> [i64; 2] {
        place.map(|part| (part / self.distance).floor() as i64)
    }

    fn add(&mut self, line: &[[f64; 2]]) {
        for place in line {
            let square = self.square(*place);
            self.squares.entry(square).or_default().push(*place);
        }
    }

    /// Whether no line is closer than `share` of the distance.
    fn is_free(&self, place: [f64; 2], share: f64) -> bool {
        let [i, j] = self.square(place);
        let around = (-1..=1).flat_map(|di| (-1..=1).map(move |dj| [i + di, j + dj]));
        let least = share * self.distance;
        around
            .filter_map(|square| self.squares.get(&square))
            .flatten()
            .all(|[x, y]| (x - place[0]).hypot(y - place[1]) >= least)
    }
}
