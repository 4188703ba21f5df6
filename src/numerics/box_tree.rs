//! A tree of boxes over triangles: halved along the longest side, down to a few.

/// Triangles in a leaf.
const LEAF: usize = 4;

/// Three corners.
pub type Triangle = [[f64; 3]; 3];

/// Lower and upper corner.
pub type Box3 = [[f64; 3]; 2];

/// Boxes in depth-first order; the left child follows its parent.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxTree {
    /// The first holds all triangles.
    pub nodes: Vec<Node>,
    /// The triangles' indices in the order of the leaves.
    pub order: Vec<u32>,
}

/// A box, of a leaf or with two children.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// The box.
    pub bounds: Box3,
    /// Index of the right child, of an inner node.
    pub right: usize,
    /// Of a leaf its part of the order.
    pub range: Option<[usize; 2]>,
}

impl BoxTree {
    /// The tree of `triangles`.
    #[must_use]
    pub fn new(triangles: &[Triangle]) -> Self {
        let mut tree = Self {
            nodes: Vec::new(),
            order: Vec::new(),
        };
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        if !order.is_empty() {
            tree.build(triangles, &mut order, 0);
        }
        tree.order = order;
        tree
    }

    /// Appends the tree of the triangles in `order`, which is at `offset` of the whole.
    fn build(&mut self, triangles: &[Triangle], order: &mut [u32], offset: usize) {
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for vertex in order.iter().flat_map(|k| &triangles[*k as usize]) {
            for k in 0..3 {
                bounds[0][k] = bounds[0][k].min(vertex[k]);
                bounds[1][k] = bounds[1][k].max(vertex[k]);
            }
        }
        let here = self.nodes.len();
        let leaf = order.len() <= LEAF;
        self.nodes.push(Node {
            bounds,
            right: 0,
            range: leaf.then_some([offset, offset + order.len()]),
        });
        if leaf {
            return;
        }
        let side = |k: usize| bounds[1][k] - bounds[0][k];
        let longest = (1..3).fold(0, |best, k| if side(k) > side(best) { k } else { best });
        let middle = order.len() / 2;
        let key = |k: &u32| {
            let [a, b, c] = &triangles[*k as usize];
            a[longest] + b[longest] + c[longest]
        };
        order.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)));
        let (left, right) = order.split_at_mut(middle);
        self.build(triangles, left, offset);
        self.nodes[here].right = self.nodes.len();
        self.build(triangles, right, offset + middle);
    }
}
