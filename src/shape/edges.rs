//! Which corners of triangles are one vertex, and how the triangles meet along their edges.

use std::collections::HashMap;

use crate::file_mesh::Triangle;

/// Two programs may round the same vertex to neighbouring numbers: roundings that are not
/// apart.
pub(super) const WELD_ROUNDINGS: f64 = 2.0;

/// Names of every triangle's corners: vertices nearer than `reach` in every coordinate are one.
pub(super) fn weld(triangles: &[Triangle], reach: f64) -> Vec<[u32; 3]> {
    let mut welder = Welder::new(reach);
    let named = |triangle: &Triangle| triangle.map(|vertex| welder.name(vertex));
    triangles.iter().map(named).collect()
}

/// Parts of the surface that share no vertex: which of them every triangle is of, and how many there are.
pub(super) fn parts(names: &[[u32; 3]]) -> (Vec<u32>, usize) {
    let count = names.as_flattened().iter().max().map_or(0, |name| name + 1);
    let mut up: Vec<u32> = (0..count).collect();
    fn root(up: &mut [u32], mut at: u32) -> u32 {
        while up[at as usize] != at {
            let over = up[up[at as usize] as usize];
            up[at as usize] = over;
            at = over;
        }
        at
    }
    for [a, b, c] in names {
        for other in [b, c] {
            let (p, q) = (root(&mut up, *a), root(&mut up, *other));
            up[p.max(q) as usize] = p.min(q);
        }
    }
    let mut numbers = vec![u32::MAX; count as usize];
    let mut parts = 0;
    let of = names.iter().map(|[a, _, _]| {
        let number = &mut numbers[root(&mut up, *a) as usize];
        if *number == u32::MAX {
            *number = parts;
            parts += 1;
        }
        *number
    });
    (of.collect(), parts as usize)
}

/// How triangles meet.
#[derive(Default)]
pub(super) struct Edges {
    pub(super) duplicate: usize,
    pub(super) open: usize,
    pub(super) crowded: usize,
    pub(super) inconsistent: usize,
    /// Edges that more triangles run along one way than the other, with how often and which way.
    pub(super) unbalanced: Vec<([u32; 2], usize)>,
    pub(super) euler: i64,
}

impl Edges {
    /// Whether every edge has exactly two triangles.
    pub(super) fn closed(&self) -> bool {
        self.open == 0 && self.crowded == 0
    }

    pub(super) fn new(names: &[[u32; 3]]) -> Self {
        // A triangle that welding closes leaves its neighbours joined.
        let open = |[a, b, c]: &&[u32; 3]| a != b && b != c && c != a;
        let mut corners: Vec<[u32; 3]> = names.iter().filter(open).copied().collect();
        let mut found = Self::default();
        // Each edge with whether it runs from the lower to the higher name.
        let mut edges: Vec<(u64, bool)> = Vec::with_capacity(3 * corners.len());
        for [a, b, c] in &corners {
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                let (low, high) = (from.min(to), from.max(to));
                edges.push((u64::from(low) << 32 | u64::from(high), from < to));
            }
        }
        edges.sort_unstable();
        let mut met = corners.as_flattened().to_vec();
        met.sort_unstable();
        met.dedup();
        found.euler = met.len() as i64 + corners.len() as i64;
        for group in edges.chunk_by(|a, b| a.0 == b.0) {
            found.euler -= 1;
            let up = group.iter().filter(|(_, up)| *up).count();
            let down = group.len() - up;
            if up != down {
                let [low, high] = [(group[0].0 >> 32) as u32, group[0].0 as u32];
                let way = if up > down { [low, high] } else { [high, low] };
                found.unbalanced.push((way, up.abs_diff(down)));
            }
            match group {
                [_] => found.open += 1,
                [a, b] => found.inconsistent += usize::from(a.1 == b.1),
                _ => found.crowded += 1,
            }
        }
        for corner in &mut corners {
            corner.sort_unstable();
        }
        corners.sort_unstable();
        found.duplicate = corners.windows(2).filter(|pair| pair[0] == pair[1]).count();
        found
    }
}

/// Gives vertices that lie together one name.
struct Welder {
    reach: f64,
    /// Side of the cells in which neighbours are looked for, wide enough that one is the rule.
    cell: f64,
    exact: HashMap<[u64; 3], u32>,
    cells: HashMap<[i64; 3], Vec<u32>>,
    points: Vec<[f64; 3]>,
}

impl Welder {
    fn new(reach: f64) -> Self {
        Self {
            reach,
            cell: 16.0 * reach,
            exact: HashMap::new(),
            cells: HashMap::new(),
            points: Vec::new(),
        }
    }

    fn name(&mut self, vertex: [f64; 3]) -> u32 {
        // Adding 0 turns -0 into 0.
        let bits = vertex.map(|c| (c + 0.0).to_bits());
        if let Some(name) = self.exact.get(&bits) {
            return *name;
        }
        let name = self.near(vertex).unwrap_or_else(|| {
            let next = self.points.len() as u32;
            self.points.push(vertex);
            if self.cell > 0.0 {
                let cell = vertex.map(|c| (c / self.cell).floor() as i64);
                self.cells.entry(cell).or_default().push(next);
            }
            next
        });
        self.exact.insert(bits, name);
        name
    }

    /// The first named point within reach.
    fn near(&self, vertex: [f64; 3]) -> Option<u32> {
        if self.cell <= 0.0 {
            return None;
        }
        // The casts saturate.
        let side = |offset: f64| vertex.map(|c| ((c + offset) / self.cell).floor() as i64);
        let (from, to) = (side(-self.reach), side(self.reach));
        let mut found: Option<u32> = None;
        for x in from[0]..=to[0] {
            for y in from[1]..=to[1] {
                for z in from[2]..=to[2] {
                    for name in self.cells.get(&[x, y, z]).into_iter().flatten() {
                        let there = self.points[*name as usize];
                        let close = (0..3).all(|k| (there[k] - vertex[k]).abs() <= self.reach);
                        if close {
                            found = Some(found.map_or(*name, |best| best.min(*name)));
                        }
                    }
                }
            }
        }
        found
    }
}
