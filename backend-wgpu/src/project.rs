//! `project` where eight of its cells march together: in an order that a kernel of our own finds.

use std::ops::Range;

use airlight_core::device::{Binding, Buf, DeviceError};
use airlight_core::stage::{Kernel as _, Project, Stage};

use crate::WgpuDevice;
use crate::cut::Cut;
use crate::part::Part;
use crate::source::order;
use crate::store::own;

fn order_of(project: &Project) -> Buf<u32> {
    Buf::new(own::ORDER, project.axis().into())
}

impl WgpuDevice {
    /// The parts of a range of `project`: the order of its cells where several march together, and its kernel.
    pub(crate) fn project_parts(
        &mut self,
        stage: &Stage,
        project: &Project,
        range: Range<u32>,
    ) -> Result<Vec<Part>, DeviceError> {
        let mut part = Part::of(stage, range.clone());
        if !self.orders(project) {
            return Ok(vec![part]);
        }
        let order = order_of(project);
        self.reserve(order.id, order.bytes())?;
        part.bindings.push(Binding::read(order::ORDER, Some(order)));
        let bindings = vec![Binding::read("occupancy", project.occupancy), Binding::write(order::ORDER, Some(order))];
        Ok(vec![Part::of_order(bindings, range), part])
    }

    /// Bytes of our own that `project` takes.
    pub(crate) fn project_scratch(&self, project: &Project) -> u64 {
        if self.orders(project) { order_of(project).bytes() } else { 0 }
    }

    /// Whether cells are taken in an order: where kernels see the whole of every buffer, and loops may turn as often.
    fn orders(&self, project: &Project) -> bool {
        let whole = Cut::new(project.axis(), 1, &project.bindings(), self.binding_limits()).is_ok_and(Cut::whole);
        let turns = order::turns(project.axis());
        self.texels && whole && self.info.limits.loop_turns.is_none_or(|most| turns <= most)
    }
}
