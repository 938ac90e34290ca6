//! A context and its queue, by `ocl::core`: the calls that this backend makes, with every fault an error of ours.
//!
//! What `ocl::core` panics at is avoided here or kept from it by the loader: buffers are never empty, no callback is
//! given, and a status that it does not know never reaches it.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::ffi::CString;
use std::mem;
use std::slice;
use std::thread;
use std::time::{Duration, Instant};

use airlight_core::device::DeviceError;
use airlight_opencl_loader::{STAND_IN, take_unknown};
use ocl::core::{
    self, ArgVal, CommandExecutionStatus, CommandQueue, CommandQueueProperties, Context, DeviceId, Error, Event,
    Kernel, KernelWorkGroupInfo, KernelWorkGroupInfoResult, MapFlags, Mem, MemFlags, MemMap, ProfilingInfo,
    ProfilingInfoResult, Program, ProgramBuildInfo, Status,
};

use crate::source::entry_point;
use crate::staged::{Staged, Waiting};

/// Work-items of a workgroup, where the device and the kernel take so many.
const WORKGROUP: usize = 64;

/// The same where each works on a packet: few, so that cores share the work evenly.
const WIDE_WORKGROUP: usize = 4;

/// A device's context and its queue, which runs in order.
#[derive(Debug)]
pub(crate) struct Cl {
    context: Context,
    device: DeviceId,
    queue: CommandQueue,
    /// Why the device is gone.
    lost: Option<String>,
    /// How long a kernel may run.
    patience: Option<Duration>,
    /// Kernels that nobody has waited for, with their names.
    under_way: VecDeque<(Event, &'static str)>,
    staged: Staged,
    /// Buffers that the host sees until the next command that may change one, and where.
    seen: RefCell<Vec<(Mem, MemMap<u8>)>>,
}

/// A kernel that was built.
#[derive(Debug)]
pub(crate) struct Built {
    name: &'static str,
    kernel: Kernel,
    /// The most work-items of a workgroup; 0 where the driver does not say.
    most: usize,
    /// Lanes of its packets.
    width: u32,
}

/// An argument of a kernel.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Arg<'a> {
    /// A struct.
    Bytes(&'a [u8]),
    Mem(&'a Mem),
    Int(i32),
    Uint(u32),
}

/// A call that failed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fault {
    status: Option<Status>,
    text: String,
}

impl Fault {
    /// Of a function of OpenCL.
    pub(crate) fn new(call: &str, error: &Error) -> Self {
        let status = error.api_status();
        let unknown = take_unknown().filter(|_| status.is_some_and(|status| status as i32 == STAND_IN));
        let text = match (status, unknown) {
            (_, Some(code)) => format!("{call}: status {code}"),
            (Some(status), None) => format!("{call}: {status} ({})", status as i32),
            // What is not a status is words of ocl's.
            (None, None) => format!("{call}: {}", error.to_string().trim()),
        };
        Self { status: status.filter(|_| unknown.is_none()), text }
    }

    /// Of a status, as tests need it.
    #[cfg(test)]
    pub(crate) fn of(status: Status, text: &str) -> Self {
        Self { status: Some(status), text: text.into() }
    }

    /// Whether there is simply none of what was asked for.
    pub(crate) fn is_none_found(&self) -> bool {
        self.status == Some(Status::CL_DEVICE_NOT_FOUND)
    }

    /// Whether nothing can be done with the device any more.
    fn loses(&self) -> bool {
        use Status::{
            CL_DEVICE_NOT_AVAILABLE, CL_INVALID_COMMAND_QUEUE, CL_INVALID_CONTEXT, CL_INVALID_DEVICE,
            CL_NV_INVALID_MEM_ACCESS,
        };
        let gone = [
            CL_DEVICE_NOT_AVAILABLE,
            CL_INVALID_COMMAND_QUEUE,
            CL_INVALID_CONTEXT,
            CL_INVALID_DEVICE,
            CL_NV_INVALID_MEM_ACCESS,
        ];
        self.status.is_some_and(|status| gone.contains(&status))
    }

    fn lacks_memory(&self) -> bool {
        use Status::{CL_MEM_OBJECT_ALLOCATION_FAILURE, CL_OUT_OF_HOST_MEMORY, CL_OUT_OF_RESOURCES};
        let lacks = [CL_MEM_OBJECT_ALLOCATION_FAILURE, CL_OUT_OF_HOST_MEMORY, CL_OUT_OF_RESOURCES];
        self.status.is_some_and(|status| lacks.contains(&status))
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

impl Cl {
    /// Opens a device. The caller sees to it that no other thread enters OpenCL meanwhile.
    pub(crate) fn open(device: DeviceId) -> Result<Self, Fault> {
        let context =
            core::create_context(None, &[device], None, None).map_err(|e| Fault::new("clCreateContext", &e))?;
        let queue = core::create_command_queue(&context, device, Some(CommandQueueProperties::PROFILING_ENABLE))
            .map_err(|e| Fault::new("clCreateCommandQueue", &e))?;
        Ok(Self {
            context,
            device,
            queue,
            lost: None,
            patience: None,
            under_way: VecDeque::new(),
            staged: Staged::default(),
            seen: RefCell::default(),
        })
    }

    /// Fails where the device is gone.
    pub(crate) fn check(&self) -> Result<(), DeviceError> {
        self.lost.as_ref().map_or(Ok(()), |text| Err(DeviceError::Lost(text.clone())))
    }

    /// The error for a fault; `requested` is the memory that the call needed. From a loss on, every call fails.
    pub(crate) fn fail(&mut self, fault: Fault, requested: u64) -> DeviceError {
        if fault.loses() {
            self.lost = Some(fault.text.clone());
            return DeviceError::Lost(fault.text);
        }
        if requested > 0 && fault.lacks_memory() {
            return DeviceError::OutOfMemory { requested, available: None };
        }
        DeviceError::Backend(fault.text)
    }

    fn done<R>(&mut self, call: &str, requested: u64, result: Result<R, Error>) -> Result<R, DeviceError> {
        result.map_err(|error| self.fail(Fault::new(call, &error), requested))
    }

    /// Makes a buffer of zeros, of at least a 4-vector.
    pub(crate) fn zeros(&mut self, bytes: u64) -> Result<Mem, DeviceError> {
        self.check()?;
        // What is mapped keeps its memory, also where it was destroyed.
        self.unsee()?;
        let size = bytes.max(16).next_multiple_of(4);
        let len = usize::try_from(size).map_err(|_| DeviceError::OutOfMemory { requested: size, available: None })?;
        // SAFETY: no memory of the host is shared.
        #[allow(unsafe_code)]
        let made = unsafe { core::create_buffer::<_, u8>(&self.context, MemFlags::READ_WRITE, len, None) };
        let mem = self.done("clCreateBuffer", size, made)?;
        let filled =
            core::enqueue_fill_buffer(&self.queue, &mem, 0u32, 0, len / 4, None::<Event>, None::<&mut Event>, None);
        self.done("clEnqueueFillBuffer", size, filled)?;
        Ok(mem)
    }

    /// Writes into a buffer from `offset` on, after all work so far. What is small is copied and written later, with what is written
    /// behind it.
    pub(crate) fn write(&mut self, mem: &Mem, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        self.check()?;
        if data.is_empty() || self.staged.join(mem, offset, data) {
            return Ok(());
        }
        self.send()?;
        self.unsee()?;
        if self.staged.wait(mem, offset, data) {
            return Ok(());
        }
        let (at, call, bytes) = (offset as usize, "clEnqueueWriteBuffer", data.len() as u64);
        self.wait_patiently()?;
        // SAFETY: the call blocks, so that the data outlive it, and the caller has checked that they fit.
        #[allow(unsafe_code)]
        let written =
            unsafe { core::enqueue_write_buffer(&self.queue, mem, true, at, data, None::<Event>, None::<&mut Event>) };
        self.done(call, bytes, written)?;
        self.staged.clear();
        Ok(())
    }

    /// Sends the write that waits, before any other command.
    fn send(&mut self) -> Result<(), DeviceError> {
        let Some(Waiting { mem, offset, data }) = self.staged.waiting() else { return Ok(()) };
        let mut event = Event::null();
        // SAFETY: the copy is kept until the write is done, and the caller of `write` has checked that it fits.
        #[allow(unsafe_code)]
        let sent = unsafe {
            let (queue, at, events) = (&self.queue, offset as usize, None::<Event>);
            core::enqueue_write_buffer(queue, &mem, false, at, &data, events, Some(&mut event))
        };
        self.done("clEnqueueWriteBuffer", data.len() as u64, sent)?;
        self.staged.keep(event, data);
        Ok(())
    }

    /// Reads from a buffer from `offset` on, after all work so far.
    pub(crate) fn read(&mut self, mem: &Mem, offset: u64, out: &mut [u8]) -> Result<(), DeviceError> {
        self.check()?;
        if out.is_empty() {
            return self.finish();
        }
        self.send()?;
        self.wait_patiently()?;
        let (at, bytes) = (offset as usize, out.len() as u64);
        // SAFETY: the call blocks, so that the memory outlives it, and the caller has checked that it fits.
        #[allow(unsafe_code)]
        let read =
            unsafe { core::enqueue_read_buffer(&self.queue, mem, true, at, out, None::<Event>, None::<&mut Event>) };
        self.done("clEnqueueReadBuffer", bytes, read)?;
        self.staged.clear();
        Ok(())
    }

    /// The first bytes of a buffer where the host sees them; none while kernels are under way or a write waits, and where a call
    /// fails.
    pub(crate) fn view(&self, mem: &Mem, bytes: u64) -> Option<&[u8]> {
        let len = usize::try_from(bytes).ok().filter(|len| *len > 0)?;
        if self.lost.is_some() || !self.under_way.is_empty() || self.staged.waits() {
            return None;
        }
        let mut seen = self.seen.borrow_mut();
        let before = seen.iter().find(|(of, _)| of.as_ptr() == mem.as_ptr()).map(|(_, map)| map.as_ptr());
        let place = match before {
            Some(place) => place,
            None => {
                let (flags, events) = (MapFlags::READ, None::<Event>);
                // SAFETY: it is unmapped before any command that may change it, and the caller says how long it is.
                #[allow(unsafe_code)]
                let map = unsafe {
                    core::enqueue_map_buffer(&self.queue, mem, true, flags, 0, len, events, None::<&mut Event>)
                };
                let map: MemMap<u8> = map.ok()?;
                let place = map.as_ptr();
                seen.push((mem.clone(), map));
                place
            }
        };
        // SAFETY: so many bytes are mapped until `unsee`, which needs this borrow to have ended.
        #[allow(unsafe_code)]
        Some(unsafe { slice::from_raw_parts(place, len) })
    }

    /// Gives what was seen back to the device, before a command that may change it.
    fn unsee(&mut self) -> Result<(), DeviceError> {
        let mut result = Ok(());
        // All of them, whatever becomes of one.
        for (mem, map) in self.seen.take() {
            let unmapped = core::enqueue_unmap_mem_object(&self.queue, &mem, &map, None::<Event>, None::<&mut Event>);
            result = result.and(self.done("clEnqueueUnmapMemObject", 0, unmapped));
        }
        result
    }

    /// Copies `bytes` between two buffers.
    pub(crate) fn copy(&mut self, from: &Mem, at: u64, to: &Mem, bytes: u64) -> Result<(), DeviceError> {
        self.check()?;
        self.send()?;
        self.unsee()?;
        let (at, len) = (at as usize, bytes as usize);
        let copied = core::enqueue_copy_buffer::<u8, _, _, _>(
            &self.queue,
            from,
            to,
            at,
            0,
            len,
            None::<Event>,
            None::<&mut Event>,
        );
        self.done("clEnqueueCopyBuffer", bytes, copied)
    }

    /// Builds the kernel whose function is the [`entry_point`] of `name`. Faults in its text begin with their file and line.
    pub(crate) fn build(
        &mut self,
        name: &'static str,
        text: &str,
        options: &str,
        width: u32,
    ) -> Result<Built, DeviceError> {
        self.check()?;
        let words =
            |text: &str| CString::new(text).map_err(|_| DeviceError::Invalid(format!("{name} contains a zero")));
        let (text, c_options) = (words(text)?, words(options)?);
        let program = core::create_program_with_source(&self.context, &[text]);
        let program = self.done("clCreateProgramWithSource", 0, program)?;
        let built = core::build_program(&program, Some(&[self.device]), &c_options, None, None);
        // ocl takes a failed build whose log is empty for a good one.
        if built.is_err() || !self.is_built(&program) {
            return Err(self.unbuilt(name, options, &program, built.err()));
        }
        let kernel = self.done("clCreateKernel", 0, core::create_kernel(&program, entry_point(name)))?;
        let most = core::get_kernel_work_group_info(&kernel, self.device, KernelWorkGroupInfo::WorkGroupSize);
        let most = if let Ok(KernelWorkGroupInfoResult::WorkGroupSize(most)) = most { most } else { 0 };
        Ok(Built { name, kernel, most, width })
    }

    fn is_built(&self, program: &Program) -> bool {
        let status = core::get_program_build_info(program, self.device, ProgramBuildInfo::BuildStatus);
        matches!(status, Ok(core::ProgramBuildInfoResult::BuildStatus(core::ProgramBuildStatus::Success)))
    }

    fn unbuilt(&mut self, name: &str, options: &str, program: &Program, error: Option<Error>) -> DeviceError {
        // A status, unlike words about the text, may say that the device is gone.
        let fault = error.as_ref().filter(|error| error.api_status().is_some());
        let fault = fault.map(|error| Fault::new("clBuildProgram", error));
        let log = match core::get_program_build_info(program, self.device, ProgramBuildInfo::BuildLog) {
            Ok(core::ProgramBuildInfoResult::BuildLog(log)) => log,
            _ => String::new(),
        };
        let log = log.trim_matches(|c: char| c.is_whitespace() || c == '\0');
        if log.is_empty() {
            let fault = fault.unwrap_or_else(|| Fault { status: None, text: "its driver does not say why".into() });
            let text = format!("the kernel {name} does not build with {options}: {fault}");
            return self.fail(Fault { text, ..fault }, 0);
        }
        // The first fault, by its file and line; then all that the compiler says.
        let first = log.lines().find(|line| line.contains("error") && line.contains("kernels/"));
        let Some(first) = first.and_then(|line| line.find("kernels/").map(|at| &line[at..])) else {
            return DeviceError::Backend(format!("the kernel {name} does not build with {options}:\n{log}"));
        };
        DeviceError::Backend(format!("{first}\n{log}"))
    }

    /// Runs a kernel over `items` work-items, whose last workgroup may reach past them; or over as many workgroups of `team`
    /// work-items at the most.
    pub(crate) fn run(
        &mut self,
        built: &Built,
        constants: &[u8],
        args: &[Arg<'_>],
        items: u64,
        team: Option<u32>,
    ) -> Result<Event, DeviceError> {
        self.check()?;
        self.send()?;
        self.unsee()?;
        for (index, arg) in (0..).zip(std::iter::once(&Arg::Bytes(constants)).chain(args)) {
            let value = match arg {
                // SAFETY: the bytes outlive the call, which copies them.
                #[allow(unsafe_code)]
                Arg::Bytes(bytes) => unsafe { ArgVal::from_raw(bytes.len(), bytes.as_ptr().cast(), false) },
                Arg::Mem(mem) => ArgVal::mem(mem),
                Arg::Int(value) => ArgVal::scalar(value),
                Arg::Uint(value) => ArgVal::scalar(value),
            };
            let set = core::set_kernel_arg(&built.kernel, index, value);
            self.done("clSetKernelArg", 0, set)?;
        }
        let size = if built.width > 1 { WIDE_WORKGROUP } else { WORKGROUP };
        let (count, local) = (usize::try_from(items).ok(), (built.most >= size).then_some(size));
        let (global, local) = match team {
            Some(team) => {
                let team = (team as usize).min(built.most.max(1));
                (count.and_then(|count| count.checked_mul(team)), Some(team))
            }
            None => (count.and_then(|count| count.checked_next_multiple_of(size)), local),
        };
        let Some(global) = global else {
            return Err(DeviceError::Limit {
                what: "the work-items of a dispatch",
                requested: items,
                limit: usize::MAX as u64,
            });
        };
        let local = local.map(|size| [size, 1, 1]);
        let mut event = Event::null();
        // SAFETY: every argument is set, memory objects are kept by the command, and stages are validated so that
        // their kernels stay within their buffers.
        #[allow(unsafe_code)]
        let sent = unsafe {
            let (queue, kernel) = (&self.queue, &built.kernel);
            core::enqueue_kernel(queue, kernel, 1, None, &[global, 1, 1], local, None::<Event>, Some(&mut event))
        };
        self.done("clEnqueueNDRangeKernel", 0, sent)?;
        let flushed = core::flush(&self.queue);
        self.done("clFlush", 0, flushed)?;
        self.under_way.push_back((event.clone(), built.name));
        Ok(event)
    }

    /// Sets how long a kernel may run from now on.
    pub(crate) fn set_patience(&mut self, patience: Option<Duration>) {
        self.patience = patience;
    }

    /// To be called before anything that waits for all work, which cannot be given up: where there is a limit of that,
    /// waits for every kernel under way.
    fn wait_patiently(&mut self) -> Result<(), DeviceError> {
        let Some(patience) = self.patience else {
            self.under_way.clear();
            return Ok(());
        };
        while let Some((event, name)) = self.under_way.pop_front() {
            // The queue runs in order, so that this kernel runs since the last one ended.
            let begin = Instant::now();
            let mut pause = Duration::from_micros(20);
            // What fails is told by what waits for it.
            while matches!(core::event_status(&event), Ok(status) if status != CommandExecutionStatus::Complete) {
                if begin.elapsed() > patience {
                    return Err(self.give_up(name, patience));
                }
                thread::sleep(pause);
                pause = (2 * pause).min(Duration::from_millis(1));
            }
        }
        Ok(())
    }

    /// Leaves a kernel that does not end to itself. Its queue and context are never released, because that may wait.
    fn give_up(&mut self, stage: &'static str, patience: Duration) -> DeviceError {
        let error = DeviceError::Timeout { stage, patience };
        self.lost = Some(error.to_string());
        mem::forget((self.queue.clone(), self.context.clone()));
        error
    }

    /// Waits for all work.
    pub(crate) fn finish(&mut self) -> Result<(), DeviceError> {
        self.check()?;
        self.send()?;
        self.wait_patiently()?;
        let waited = core::finish(&self.queue);
        self.done("clFinish", 0, waited)?;
        self.staged.clear();
        Ok(())
    }

    /// Nanoseconds that a kernel ran, after it has.
    pub(crate) fn time(&mut self, event: &Event) -> Result<u64, DeviceError> {
        // A kernel that failed has a status below zero, which ocl cannot put into words.
        if let Err(error) = core::event_status(event) {
            let failed = Fault { status: None, text: "a kernel failed while it ran".into() };
            let fault = error.api_status().map_or(failed, |_| Fault::new("clGetEventInfo", &error));
            return Err(self.fail(fault, 0));
        }
        let mut stamp = |which| {
            let stamp = core::get_event_profiling_info(event, which);
            self.done("clGetEventProfilingInfo", 0, stamp)
        };
        match (stamp(ProfilingInfo::Start)?, stamp(ProfilingInfo::End)?) {
            (ProfilingInfoResult::Start(start), ProfilingInfoResult::End(end)) => Ok(end.saturating_sub(start)),
            _ => Ok(0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_status_says_of_the_device() {
        for status in [Status::CL_DEVICE_NOT_AVAILABLE, Status::CL_NV_INVALID_MEM_ACCESS, Status::CL_INVALID_CONTEXT] {
            assert!(Fault::of(status, "call").loses(), "{status}");
        }
        for status in [Status::CL_OUT_OF_RESOURCES, Status::CL_MEM_OBJECT_ALLOCATION_FAILURE] {
            assert!(Fault::of(status, "call").lacks_memory() && !Fault::of(status, "call").loses(), "{status}");
        }
        assert!(Fault::of(Status::CL_DEVICE_NOT_FOUND, "call").is_none_found());
    }
}
