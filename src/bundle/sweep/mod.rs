//! The files of a sweep: the plan, one small file a point, the table.

mod plan;
mod point;
mod store;
mod summary;
mod table;

pub use plan::{ArrayTask, Axis, Mode, POINTS_MAX, PlanFile, Value};
pub use point::{ArrayMerit, ArrayRow, IronRow, OptimumRow, PointFile, Row, Status};
pub use store::{PointStore, StoredPoint};
pub use summary::MergeSummary;
pub use table::{
    ARRAY_COLUMNS, IRON_COLUMNS, OPTIMUM_COLUMNS, ROW_COLUMNS, TableWriter, columns, value_text,
};
