# graybox_kernel_sources(stem): sources of a family of kernels that is compiled once for each vector
# width and chosen at run time: stem.cpp (the choice), stem_generic.cpp, and on x86-64 stem_avx2.cpp
# and stem_avx512.cpp with the flags that only these files get.
function(graybox_kernel_sources stem)
  graybox_sources(${stem}.cpp ${stem}_generic.cpp)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    graybox_sources(${stem}_avx2.cpp ${stem}_avx512.cpp)
    set_source_files_properties(${stem}_avx2.cpp DIRECTORY ${graybox_collecting} PROPERTIES
      COMPILE_OPTIONS "-mavx2;-mfma;-O3")
    set_source_files_properties(${stem}_avx512.cpp DIRECTORY ${graybox_collecting} PROPERTIES
      COMPILE_OPTIONS "-mavx512f;-mavx512dq;-mavx512vl;-mfma;-O3;-mprefer-vector-width=512")
  endif()
endfunction()
