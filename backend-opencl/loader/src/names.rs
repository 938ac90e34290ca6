//! The functions' names.

/// Calls a macro with the name of every function that cl-sys declares.
macro_rules! names {
    ($then:ident) => {
        $then! {
            clBuildProgram clCompileProgram clCreateBuffer clCreateCommandQueue clCreateContext
            clCreateContextFromType clCreateFromGLBuffer clCreateFromGLRenderbuffer clCreateFromGLTexture
            clCreateFromGLTexture2D clCreateFromGLTexture3D clCreateImage clCreateImage2D clCreateImage3D
            clCreateKernel clCreateKernelsInProgram clCreateProgramWithBinary clCreateProgramWithBuiltInKernels
            clCreateProgramWithSource clCreateSampler clCreateSubBuffer clCreateSubDevices clCreateUserEvent
            clEnqueueAcquireGLObjects clEnqueueBarrier clEnqueueBarrierWithWaitList clEnqueueCopyBuffer
            clEnqueueCopyBufferRect clEnqueueCopyBufferToImage clEnqueueCopyImage clEnqueueCopyImageToBuffer
            clEnqueueFillBuffer clEnqueueFillImage clEnqueueMapBuffer clEnqueueMapImage clEnqueueMarker
            clEnqueueMarkerWithWaitList clEnqueueMigrateMemObjects clEnqueueNDRangeKernel clEnqueueNativeKernel
            clEnqueueReadBuffer clEnqueueReadBufferRect clEnqueueReadImage clEnqueueReleaseGLObjects clEnqueueTask
            clEnqueueUnmapMemObject clEnqueueWaitForEvents clEnqueueWriteBuffer clEnqueueWriteBufferRect
            clEnqueueWriteImage clFinish clFlush clGetCommandQueueInfo clGetContextInfo clGetDeviceIDs
            clGetDeviceInfo clGetEventInfo clGetEventProfilingInfo clGetExtensionFunctionAddress
            clGetExtensionFunctionAddressForPlatform clGetGLContextInfoKHR clGetGLObjectInfo clGetGLTextureInfo
            clGetImageInfo clGetKernelArgInfo clGetKernelInfo clGetKernelWorkGroupInfo clGetMemObjectInfo
            clGetPlatformIDs clGetPlatformInfo clGetProgramBuildInfo clGetProgramInfo clGetSamplerInfo
            clGetSupportedImageFormats clLinkProgram clReleaseCommandQueue clReleaseContext clReleaseDevice
            clReleaseEvent clReleaseKernel clReleaseMemObject clReleaseProgram clReleaseSampler clRetainCommandQueue
            clRetainContext clRetainDevice clRetainEvent clRetainKernel clRetainMemObject clRetainProgram
            clRetainSampler clSetEventCallback clSetKernelArg clSetMemObjectDestructorCallback clSetUserEventStatus
            clUnloadCompiler clWaitForEvents
        }
    };
}
