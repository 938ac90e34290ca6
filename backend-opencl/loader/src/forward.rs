//! The functions that cl-sys declares, defined here: each finds its namesake in the library on its first call.

#![allow(clippy::missing_safety_doc, reason = "these are OpenCL's own functions, safe as OpenCL says they are")]

use std::ffi::c_void;
use std::sync::OnceLock;

use cl_sys::*;

use crate::{library, status};

/// The status of a call without a library.
const NO_LIBRARY: cl_int = -1001;
/// `CL_SUCCESS`.
const SUCCESS: cl_int = 0;

/// Defines functions of the kinds that OpenCL has. Each is checked against the declaration of cl-sys.
macro_rules! forward {
    // Gives a status, which is made one that ocl knows.
    (status $(fn $name:ident($($arg:ident: $ty:ty),* $(,)?) -> cl_int;)*) => {$(
        forward!(@define $name($($arg: $ty),*) -> cl_int {
            forward!(@found $name($($ty),*) -> cl_int)
                .map_or(NO_LIBRARY, |function| status::known(unsafe { function($($arg),*) }))
        });
    )*};
    // Releases an object. ocl panics in `drop` where that fails, and nothing can be done about it there.
    (release $(fn $name:ident($arg:ident: $ty:ty) -> cl_int;)*) => {$(
        forward!(@define $name($arg: $ty) -> cl_int {
            if let Some(function) = forward!(@found $name($ty) -> cl_int) {
                unsafe { function($arg) };
            }
            SUCCESS
        });
    )*};
    // Makes an object, and gives the status through its last argument.
    (object $(fn $name:ident($($arg:ident: $ty:ty),* $(,)?) -> $ret:ty;)*) => {$(
        forward!(@define $name($($arg: $ty),*) -> $ret {
            let found = forward!(@found $name($($ty),*) -> $ret);
            let made = found.map_or(std::ptr::null_mut(), |function| unsafe { function($($arg),*) });
            let status_at = forward!(@last $($arg),*);
            if !status_at.is_null() {
                // SAFETY: the caller gave a place for the status.
                unsafe { *status_at = if found.is_none() { NO_LIBRARY } else { status::known(*status_at) } };
            }
            made
        });
    )*};
    (@last $last:ident) => { $last };
    (@last $first:ident, $($rest:ident),+) => { forward!(@last $($rest),+) };
    // The library's function, looked for once.
    (@found $name:ident($($ty:ty),*) -> $ret:ty) => {{
        type Function = unsafe extern "system" fn($($ty),*) -> $ret;
        static FOUND: OnceLock<Option<Function>> = OnceLock::new();
        // SAFETY: OpenCL's function of that name has that type.
        *FOUND.get_or_init(|| unsafe { library::find::<Function>(concat!(stringify!($name), "\0").as_bytes()) })
    }};
    (@define $name:ident($($arg:ident: $ty:ty),*) -> $ret:ty $body:block) => {
        #[unsafe(no_mangle)]
        unsafe extern "system" fn $name($($arg: $ty),*) -> $ret $body
        const _: unsafe extern "system" fn($($ty),*) -> $ret = cl_sys::$name;
    };
}

forward! { status
    fn clGetPlatformInfo(platform: cl_platform_id, param_name: cl_platform_info, param_value_size: size_t,
        param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clGetDeviceInfo(device: cl_device_id, param_name: cl_device_info, param_value_size: size_t,
        param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clCreateSubDevices(in_device: cl_device_id, properties: *const cl_device_partition_property,
        num_devices: cl_uint, out_devices: *mut cl_device_id, num_devices_ret: *mut cl_uint) -> cl_int;
    fn clRetainDevice(device: cl_device_id) -> cl_int;
    fn clRetainContext(context: cl_context) -> cl_int;
    fn clGetContextInfo(context: cl_context, param_name: cl_context_info, param_value_size: size_t,
        param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clRetainCommandQueue(command_queue: cl_command_queue) -> cl_int;
    fn clGetCommandQueueInfo(command_queue: cl_command_queue, param_name: cl_command_queue_info,
        param_value_size: size_t, param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clRetainMemObject(memobj: cl_mem) -> cl_int;
    fn clGetSupportedImageFormats(context: cl_context, flags: cl_mem_flags, image_type: cl_mem_object_type,
        num_entries: cl_uint, image_formats: *mut cl_image_format, num_image_formats: *mut cl_uint) -> cl_int;
    fn clGetMemObjectInfo(memobj: cl_mem, param_name: cl_mem_info, param_value_size: size_t, param_value: *mut c_void,
        param_value_size_ret: *mut size_t) -> cl_int;
    fn clGetImageInfo(image: cl_mem, param_name: cl_image_info, param_value_size: size_t, param_value: *mut c_void,
        param_value_size_ret: *mut size_t) -> cl_int;
    fn clSetMemObjectDestructorCallback(memobj: cl_mem, pfn_notify: Option<extern "C" fn(cl_mem, *mut c_void)>,
        user_data: *mut c_void) -> cl_int;
    fn clRetainSampler(sampler: cl_sampler) -> cl_int;
    fn clGetSamplerInfo(sampler: cl_sampler, param_name: cl_sampler_info, param_value_size: size_t,
        param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clRetainProgram(program: cl_program) -> cl_int;
    fn clBuildProgram(program: cl_program, num_devices: cl_uint, device_list: *const cl_device_id,
        options: *const c_char, pfn_notify: Option<extern "C" fn(cl_program, *mut c_void)>, user_data: *mut c_void) -> cl_int;
    fn clUnloadCompiler() -> cl_int;
    fn clCompileProgram(program: cl_program, num_devices: cl_uint, device_list: *const cl_device_id,
        options: *const c_char, num_input_headers: cl_uint, input_headers: *const cl_program,
        header_include_names: *const *const c_char,
        pfn_notify: Option<extern "C" fn(program: cl_program, user_data: *mut c_void)>, user_data: *mut c_void) -> cl_int;
    fn clGetProgramInfo(program: cl_program, param_name: cl_program_info, param_value_size: size_t,
        param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clGetProgramBuildInfo(program: cl_program, device: cl_device_id, param_name: cl_program_build_info,
        param_value_size: size_t, param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clCreateKernelsInProgram(program: cl_program, num_kernels: cl_uint, kernels: *mut cl_kernel,
        num_kernels_ret: *mut cl_uint) -> cl_int;
    fn clRetainKernel(kernel: cl_kernel) -> cl_int;
    fn clSetKernelArg(kernel: cl_kernel, arg_index: cl_uint, arg_size: size_t, arg_value: *const c_void) -> cl_int;
    fn clGetKernelInfo(kernel: cl_kernel, param_name: cl_kernel_info, param_value_size: size_t,
        param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clGetKernelArgInfo(kernel: cl_kernel, arg_indx: cl_uint, param_name: cl_kernel_arg_info,
        param_value_size: size_t, param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clGetKernelWorkGroupInfo(kernel: cl_kernel, device: cl_device_id, param_name: cl_kernel_work_group_info,
        param_value_size: size_t, param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clWaitForEvents(num_events: cl_uint, event_list: *const cl_event) -> cl_int;
    fn clGetEventInfo(event: cl_event, param_name: cl_event_info, param_value_size: size_t, param_value: *mut c_void,
        param_value_size_ret: *mut size_t) -> cl_int;
    fn clRetainEvent(event: cl_event) -> cl_int;
    fn clSetUserEventStatus(event: cl_event, execution_status: cl_int) -> cl_int;
    fn clSetEventCallback(event: cl_event, command_exec_callback_type: cl_int,
        pfn_notify: Option<extern "C" fn(cl_event, cl_int, *mut c_void)>, user_data: *mut c_void) -> cl_int;
    fn clGetEventProfilingInfo(event: cl_event, param_name: cl_profiling_info, param_value_size: size_t,
        param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clFlush(command_queue: cl_command_queue) -> cl_int;
    fn clFinish(command_queue: cl_command_queue) -> cl_int;
    fn clEnqueueReadBuffer(command_queue: cl_command_queue, buffer: cl_mem, blocking_read: cl_bool, offset: size_t,
        cb: size_t, ptr: *mut c_void, num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event,
        event: *mut cl_event) -> cl_int;
    fn clEnqueueReadBufferRect(command_queue: cl_command_queue, buffer: cl_mem, blocking_read: cl_bool,
        buffer_origin: *const size_t, host_origin: *const size_t, region: *const size_t, buffer_row_pitch: size_t,
        buffer_slc_pitch: size_t, host_row_pitch: size_t, host_slc_pitch: size_t, ptr: *mut c_void,
        num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueWriteBuffer(command_queue: cl_command_queue, buffer: cl_mem, blocking_write: cl_bool, offset: size_t,
        cb: size_t, ptr: *const c_void, num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event,
        event: *mut cl_event) -> cl_int;
    fn clEnqueueWriteBufferRect(command_queue: cl_command_queue, buffer: cl_mem, blocking_write: cl_bool,
        buffer_origin: *const size_t, host_origin: *const size_t, region: *const size_t, buffer_row_pitch: size_t,
        buffer_slc_pitch: size_t, host_row_pitch: size_t, host_slc_pitch: size_t, ptr: *const c_void,
        num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueFillBuffer(command_queue: cl_command_queue, buffer: cl_mem, pattern: *const c_void,
        pattern_size: size_t, offset: size_t, size: size_t, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueCopyBuffer(command_queue: cl_command_queue, src_buffer: cl_mem, dst_buffer: cl_mem,
        src_offset: size_t, dst_offset: size_t, cb: size_t, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueCopyBufferRect(command_queue: cl_command_queue, src_buffer: cl_mem, dst_buffer: cl_mem,
        src_origin: *const size_t, dst_origin: *const size_t, region: *const size_t, src_row_pitch: size_t,
        src_slc_pitch: size_t, dst_row_pitch: size_t, dst_slc_pitch: size_t, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueReadImage(command_queue: cl_command_queue, image: cl_mem, blocking_read: cl_bool,
        origin: *const size_t, region: *const size_t, row_pitch: size_t, slc_pitch: size_t, ptr: *mut c_void,
        num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueWriteImage(command_queue: cl_command_queue, image: cl_mem, blocking_write: cl_bool,
        origin: *const size_t, region: *const size_t, input_row_pitch: size_t, input_slc_pitch: size_t,
        ptr: *const c_void, num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueFillImage(command_queue: cl_command_queue, image: cl_mem, fill_color: *const c_void,
        origin: *const size_t, region: *const size_t, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueCopyImage(command_queue: cl_command_queue, src_image: cl_mem, dst_image: cl_mem,
        src_origin: *const size_t, dst_origin: *const size_t, region: *const size_t, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueCopyImageToBuffer(command_queue: cl_command_queue, src_image: cl_mem, dst_buffer: cl_mem,
        src_origin: *const size_t, region: *const size_t, dst_offset: size_t, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueCopyBufferToImage(command_queue: cl_command_queue, src_buffer: cl_mem, dst_image: cl_mem,
        src_offset: size_t, dst_origin: *const size_t, region: *const size_t, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueUnmapMemObject(command_queue: cl_command_queue, memobj: cl_mem, mapped_ptr: *mut c_void,
        num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueMigrateMemObjects(command_queue: cl_command_queue, num_mem_objects: cl_uint,
        mem_objects: *const cl_mem, flags: cl_mem_migration_flags, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueNDRangeKernel(command_queue: cl_command_queue, kernel: cl_kernel, work_dim: cl_uint,
        global_work_offset: *const size_t, global_work_dims: *const size_t, local_work_dims: *const size_t,
        num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueTask(command_queue: cl_command_queue, kernel: cl_kernel, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueNativeKernel(command_queue: cl_command_queue, user_func: Option<extern "C" fn(*mut c_void)>,
        args: *mut c_void, cb_args: size_t, num_mem_objects: cl_uint, mem_list: *const cl_mem,
        args_mem_loc: *const *const c_void, num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event,
        event: *mut cl_event) -> cl_int;
    fn clEnqueueMarker(command_queue: cl_command_queue, event: *mut cl_event) -> cl_int;
    fn clEnqueueMarkerWithWaitList(command_queue: cl_command_queue, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueWaitForEvents(command_queue: cl_command_queue, num_events: cl_uint, event_list: *mut cl_event) -> cl_int;
    fn clEnqueueBarrierWithWaitList(command_queue: cl_command_queue, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueBarrier(command_queue: cl_command_queue) -> cl_int;
    fn clGetGLObjectInfo(memobj: cl_mem, gl_object_type: *mut cl_gl_object_type, gl_object_name: *mut cl_GLuint) -> cl_int;
    fn clGetGLTextureInfo(memobj: cl_mem, param_name: cl_gl_texture_info, param_value_size: size_t,
        param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
    fn clEnqueueAcquireGLObjects(command_queue: cl_command_queue, num_objects: cl_uint, mem_objects: *const cl_mem,
        num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clEnqueueReleaseGLObjects(command_queue: cl_command_queue, num_objects: cl_uint, mem_objects: *const cl_mem,
        num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event, event: *mut cl_event) -> cl_int;
    fn clGetGLContextInfoKHR(properties: *const cl_context_properties, param_name: cl_gl_context_info,
        param_value_size: size_t, param_value: *mut c_void, param_value_size_ret: *mut size_t) -> cl_int;
}

forward! { release
    fn clReleaseDevice(device: cl_device_id) -> cl_int;
    fn clReleaseContext(context: cl_context) -> cl_int;
    fn clReleaseCommandQueue(command_queue: cl_command_queue) -> cl_int;
    fn clReleaseMemObject(memobj: cl_mem) -> cl_int;
    fn clReleaseSampler(sampler: cl_sampler) -> cl_int;
    fn clReleaseProgram(program: cl_program) -> cl_int;
    fn clReleaseKernel(kernel: cl_kernel) -> cl_int;
    fn clReleaseEvent(event: cl_event) -> cl_int;
}

forward! { object
    fn clCreateContext(properties: *const cl_context_properties, num_devices: cl_uint, devices: *const cl_device_id,
        pfn_notify: Option<extern "C" fn(*const c_char, *const c_void, size_t, *mut c_void)>, user_data: *mut c_void,
        errcode_ret: *mut cl_int) -> cl_context;
    fn clCreateContextFromType(properties: *const cl_context_properties, device_type: cl_device_type,
        pfn_notify: Option<extern "C" fn(*const c_char, *const c_void, size_t, *mut c_void)>, user_data: *mut c_void,
        errcode_ret: *mut cl_int) -> cl_context;
    fn clCreateCommandQueue(context: cl_context, device: cl_device_id, properties: cl_command_queue_properties,
        errcode_ret: *mut cl_int) -> cl_command_queue;
    fn clCreateBuffer(context: cl_context, flags: cl_mem_flags, size: size_t, host_ptr: *mut c_void,
        errcode_ret: *mut cl_int) -> cl_mem;
    fn clCreateSubBuffer(buffer: cl_mem, flags: cl_mem_flags, buffer_create_type: cl_buffer_create_type,
        buffer_create_info: *const c_void, errcode_ret: *mut cl_int) -> cl_mem;
    fn clCreateImage2D(context: cl_context, flags: cl_mem_flags, image_format: *mut cl_image_format,
        image_width: size_t, image_depth: size_t, image_slc_pitch: size_t, host_ptr: *mut c_void,
        errcode_ret: *mut cl_int) -> cl_mem;
    fn clCreateImage3D(context: cl_context, flags: cl_mem_flags, image_format: *mut cl_image_format,
        image_width: size_t, image_height: size_t, image_depth: size_t, image_row_pitch: size_t,
        image_slc_pitch: size_t, host_ptr: *mut c_void, errcode_ret: *mut cl_int) -> cl_mem;
    fn clCreateImage(context: cl_context, flags: cl_mem_flags, image_format: *const cl_image_format,
        image_desc: *const cl_image_desc, host_ptr: *mut c_void, errcode_ret: *mut cl_int) -> cl_mem;
    fn clCreateSampler(context: cl_context, normalize_coords: cl_bool, addressing_mode: cl_addressing_mode,
        filter_mode: cl_filter_mode, errcode_ret: *mut cl_int) -> cl_sampler;
    fn clCreateProgramWithSource(context: cl_context, count: cl_uint, strings: *const *const c_char,
        lengths: *const size_t, errcode_ret: *mut cl_int) -> cl_program;
    fn clCreateProgramWithBinary(context: cl_context, num_devices: cl_uint, device_list: *const cl_device_id,
        lengths: *const size_t, binaries: *const *const c_uchar, binary_status: *mut cl_int, errcode_ret: *mut cl_int) -> cl_program;
    fn clCreateProgramWithBuiltInKernels(context: cl_context, num_devices: cl_uint, device_list: *const cl_device_id,
        kernel_names: *const char, errcode_ret: *mut cl_int) -> cl_program;
    fn clLinkProgram(context: cl_context, num_devices: cl_uint, device_list: *const cl_device_id,
        options: *const c_char, num_input_programs: cl_uint, input_programs: *const cl_program,
        pfn_notify: Option<extern "C" fn(program: cl_program, user_data: *mut c_void)>, user_data: *mut c_void,
        errcode_ret: *mut cl_int) -> cl_program;
    fn clCreateKernel(program: cl_program, kernel_name: *const c_char, errcode_ret: *mut cl_int) -> cl_kernel;
    fn clCreateUserEvent(context: cl_context, errcode_ret: *mut cl_int) -> cl_event;
    fn clEnqueueMapBuffer(command_queue: cl_command_queue, buffer: cl_mem, blocking_map: cl_bool,
        map_flags: cl_map_flags, offset: size_t, size: size_t, num_events_in_wait_list: cl_uint,
        event_wait_list: *const cl_event, event: *mut cl_event, errcode_ret: *mut cl_int) -> *mut c_void;
    fn clEnqueueMapImage(command_queue: cl_command_queue, image: cl_mem, blocking_map: cl_bool,
        map_flags: cl_map_flags, origin: *const size_t, region: *const size_t, image_row_pitch: *mut size_t,
        image_slc_pitch: *mut size_t, num_events_in_wait_list: cl_uint, event_wait_list: *const cl_event,
        event: *mut cl_event, errcode_ret: *mut cl_int) -> *mut c_void;
    fn clCreateFromGLBuffer(context: cl_context, flags: cl_mem_flags, bufobj: cl_GLuint, errcode_ret: *mut cl_int) -> cl_mem;
    fn clCreateFromGLTexture(context: cl_context, flags: cl_mem_flags, texture_target: cl_GLenum, miplevel: cl_GLint,
        texture: cl_GLuint, errcode_ret: *mut cl_int) -> cl_mem;
    fn clCreateFromGLRenderbuffer(context: cl_context, flags: cl_mem_flags, renderbuffer: cl_GLuint,
        errcode_ret: *mut cl_int) -> cl_mem;
    fn clCreateFromGLTexture2D(context: cl_context, flags: cl_mem_flags, texture_target: cl_GLenum,
        miplevel: cl_GLint, texture: cl_GLuint, errcode_ret: *mut cl_int) -> cl_mem;
    fn clCreateFromGLTexture3D(context: cl_context, flags: cl_mem_flags, texture_target: cl_GLenum,
        miplevel: cl_GLint, texture: cl_GLuint, errcode_ret: *mut cl_int) -> cl_mem;
}

// ocl waits ten seconds where there is no platform, and takes an empty list for an answer.
forward!(@define clGetPlatformIDs(count: cl_uint, platforms: *mut cl_platform_id, found: *mut cl_uint) -> cl_int {
    let function = forward!(@found clGetPlatformIDs(cl_uint, *mut cl_platform_id, *mut cl_uint) -> cl_int);
    let code = function.map_or(NO_LIBRARY, |function| unsafe { function(count, platforms, found) });
    if code == NO_LIBRARY {
        if !found.is_null() {
            // SAFETY: the caller gave a place for the number.
            unsafe { *found = 0 };
        }
        return SUCCESS;
    }
    status::known(code)
});

// ocl believes the number of devices also where it exceeds the places that it gave.
forward!(@define clGetDeviceIDs(
    platform: cl_platform_id, kind: cl_device_type, count: cl_uint, devices: *mut cl_device_id, found: *mut cl_uint
) -> cl_int {
    let function = forward!(@found clGetDeviceIDs(
        cl_platform_id, cl_device_type, cl_uint, *mut cl_device_id, *mut cl_uint
    ) -> cl_int);
    let code = function.map_or(NO_LIBRARY, |function| unsafe { function(platform, kind, count, devices, found) });
    if !devices.is_null() && !found.is_null() {
        // SAFETY: the caller gave a place for the number.
        unsafe { *found = (*found).min(count) };
    }
    status::known(code)
});

forward!(@define clGetExtensionFunctionAddressForPlatform(
    platform: cl_platform_id, name: *const c_char
) -> *mut c_void {
    let function = forward!(@found clGetExtensionFunctionAddressForPlatform(
        cl_platform_id, *const c_char
    ) -> *mut c_void);
    function.map_or(std::ptr::null_mut(), |function| unsafe { function(platform, name) })
});

// cl-sys declares it without the address that it gives, so there is nothing to forward.
forward!(@define clGetExtensionFunctionAddress(_name: *mut c_char) -> () {});

macro_rules! addresses {
    ($($name:ident)*) => {
        /// Every function, so that a linker takes all of them that takes this.
        pub(crate) static ALL: &[Address] = &[$(Address($name as *const ())),*];
    };
}
names!(addresses);

/// Address of a function.
pub(crate) struct Address(#[expect(dead_code, reason = "it is there to be linked")] *const ());

// SAFETY: nothing is read through it.
unsafe impl Sync for Address {}
