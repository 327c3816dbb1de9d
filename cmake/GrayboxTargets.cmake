# Helpers every folder uses to declare its library, so that warnings, include paths and export
# names are the same everywhere.

# In this repository headers are included from its root ("solvers/registry.hpp"); in programs that use
# the installed package as "graybox/solvers/registry.hpp" (GrayboxInstall.cmake). A folder of links in
# the build tree makes the second spelling work for the examples of the docs.
function(graybox_link_include_tree)
  set(root "${CMAKE_BINARY_DIR}/include/graybox")
  file(MAKE_DIRECTORY "${root}")
  foreach(folder problems solvers diagnosis)
    if(EXISTS "${CMAKE_SOURCE_DIR}/${folder}")
      file(CREATE_LINK "${CMAKE_SOURCE_DIR}/${folder}" "${root}/${folder}" SYMBOLIC)
    endif()
  endforeach()
endfunction()

# graybox_collect(VARIABLE folder...): the sources of these folders, whose CMakeLists.txt name them by
# graybox_sources(). The order counts: a folder includes from those before it (scripts/check_layers).
function(graybox_collect variable)
  set(graybox_collecting ${CMAKE_CURRENT_SOURCE_DIR})
  set_property(GLOBAL PROPERTY GRAYBOX_COLLECTED "")
  foreach(folder IN LISTS ARGN)
    if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/CMakeLists.txt)  # else headers alone
      add_subdirectory(${folder})
    endif()
  endforeach()
  get_property(collected GLOBAL PROPERTY GRAYBOX_COLLECTED)
  set(${variable} ${collected} PARENT_SCOPE)
endfunction()

# graybox_sources(a.cpp b.cpp ...): of this folder.
function(graybox_sources)
  foreach(file IN LISTS ARGN)
    file(RELATIVE_PATH path ${graybox_collecting} ${CMAKE_CURRENT_SOURCE_DIR}/${file})
    set_property(GLOBAL APPEND PROPERTY GRAYBOX_COLLECTED ${path})
  endforeach()
endfunction()

# graybox_of_one_kind(a b.cpp ...): these sources of this folder are in builds with the diagnosis alone,
# or without it alone. They are compiled in groups of their own, so that all other groups are the same
# in both and ccache compiles them once.
function(graybox_of_one_kind)
  foreach(file IN LISTS ARGN)
    if(NOT file MATCHES "[.]cpp$")
      string(APPEND file ".cpp")
    endif()
    set_property(GLOBAL APPEND PROPERTY GRAYBOX_OF_ONE_KIND ${CMAKE_CURRENT_SOURCE_DIR}/${file})
  endforeach()
endfunction()

# graybox_unity(target): with GRAYBOX_UNITY, compiles the target's sources in groups
# (scripts/unity_groups), because reading the headers is most of the work. Kernels stay apart: they
# are the same code for several processors. So does what has options of its own.
function(graybox_unity target)
  if(NOT GRAYBOX_UNITY)
    return()
  endif()
  get_target_property(sources ${target} SOURCES)
  list(FILTER sources EXCLUDE REGEX "^/|kernels/")
  list(LENGTH sources count)
  if(count LESS 2)
    return()
  endif()
  get_property(all_of_one_kind GLOBAL PROPERTY GRAYBOX_OF_ONE_KIND)
  set(of_one_kind "")
  foreach(source IN LISTS sources)
    if("${CMAKE_CURRENT_SOURCE_DIR}/${source}" IN_LIST all_of_one_kind)
      list(APPEND of_one_kind ${source})
    endif()
  endforeach()
  if(of_one_kind)
    list(REMOVE_ITEM sources ${of_one_kind})
  endif()
  set(grouping "${CMAKE_SOURCE_DIR}/scripts/unity_groups")
  execute_process(
    COMMAND ${Python3_EXECUTABLE} ${grouping} ${GRAYBOX_UNITY_SIZE} ${sources} -- ${of_one_kind}
    WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} OUTPUT_VARIABLE groups COMMAND_ERROR_IS_FATAL ANY)
  string(REGEX MATCHALL "[^\n]+" groups "${groups}")
  foreach(line IN LISTS groups)
    string(REPLACE ":" ";" line "${line}")
    list(GET line 0 group)
    list(GET line 1 source)
    get_source_file_property(is_grouped ${source} UNITY_GROUP)
    if(NOT is_grouped)  # else by another target of this folder, and this one takes its groups
      set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${target}_${group})
    endif()
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  # A class may hold what is private to its source file; in a group gcc can't see that.
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  # Groups are made when CMake runs. Where a new name meets another of its group the compiler says
  # so: run cmake again.
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${grouping})
endfunction()

# graybox_compile_options(target [UNSANITIZED]): UNSANITIZED links the sanitizers' runtime alone.
function(graybox_compile_options target)
  cmake_parse_arguments(arg "UNSANITIZED" "" "" ${ARGN})
  target_compile_options(${target} PRIVATE
    -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion
    -Wnon-virtual-dtor -Woverloaded-virtual)
  if(GRAYBOX_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(GRAYBOX_NATIVE)
    target_compile_options(${target} PRIVATE -march=native)
  endif()
  if(GRAYBOX_SANITIZE)
    target_link_options(${target} PRIVATE -fsanitize=${GRAYBOX_SANITIZE})
  endif()
  if(GRAYBOX_SANITIZE AND NOT arg_UNSANITIZED)
    # Eigen changes its allocator under the address sanitizer unless told that malloc aligns; all
    # that is linked together has to allocate alike.
    target_compile_options(${target} PRIVATE -fsanitize=${GRAYBOX_SANITIZE} -fno-omit-frame-pointer
      -DEIGEN_MALLOC_ALREADY_ALIGNED=1)
    if(GRAYBOX_SANITIZE MATCHES "undefined")
      # These checks stand before every access; through Eigen's templates they double the time to
      # compile and find what the address sanitizer finds anyway.
      target_compile_options(${target} PRIVATE -fno-sanitize=null,alignment,object-size,vptr)
    endif()
    if(NOT GRAYBOX_WARNINGS_AS_ERRORS)  # the release build has warned
      target_compile_options(${target} PRIVATE -w)
    endif()
  endif()
  if(GRAYBOX_FUZZ_COVERAGE)
    # Counters that are kept in the file, so that processes that die have theirs counted, too.
    target_compile_options(${target} PRIVATE -fprofile-instr-generate -fcoverage-mapping
      -mllvm -runtime-counter-relocation)
    target_link_options(${target} PRIVATE -fprofile-instr-generate)
  elseif(GRAYBOX_FUZZ)
    target_compile_options(${target} PRIVATE -fsanitize=fuzzer-no-link)
  endif()
  if(GRAYBOX_COVERAGE)
    target_compile_options(${target} PRIVATE --coverage)
    target_link_options(${target} PRIVATE --coverage)
  endif()
endfunction()

# graybox_library(name SOURCES a.cpp b.cpp PUBLIC libs... PRIVATE libs... [COMPONENT name])
# makes the target graybox_<name> with the alias graybox::<name>. It is installed with COMPONENT, by
# default the folder at the top that it lies in, and is shared with BUILD_SHARED_LIBS. What is not
# installed becomes part of the program.
function(graybox_library name)
  cmake_parse_arguments(arg "" "COMPONENT" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  if(NOT arg_COMPONENT)
    file(RELATIVE_PATH arg_COMPONENT ${CMAKE_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
    string(REGEX REPLACE "/.*" "" arg_COMPONENT ${arg_COMPONENT})
  endif()
  set(target graybox_${name})
  set(type STATIC)
  if(BUILD_SHARED_LIBS AND arg_COMPONENT IN_LIST graybox_components)
    set(type SHARED)
  endif()
  add_library(${target} ${type} ${arg_SOURCES})
  add_library(graybox::${name} ALIAS ${target})
  # No symbol that tells a shared build: its objects are those of a static one.
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} DEFINE_SYMBOL ""
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  if(type STREQUAL "SHARED")
    target_link_options(${target} PRIVATE -Wl,--no-undefined)
  endif()
  target_include_directories(${target} PUBLIC
    $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE})
  graybox_compile_options(${target})
  graybox_unity(${target})
  set_property(GLOBAL APPEND PROPERTY GRAYBOX_LIBRARIES_${arg_COMPONENT} ${target})
endfunction()

# graybox_executable(name [UNSANITIZED] SOURCES ... LINK ...)
function(graybox_executable name)
  cmake_parse_arguments(arg "UNSANITIZED" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_LINK})
  if(arg_UNSANITIZED)
    graybox_compile_options(${name} UNSANITIZED)
  else()
    graybox_compile_options(${name})
  endif()
  graybox_unity(${name})
  # Whatever reads HDF5 or MAT files starts it.
  if(NOT name STREQUAL "graybox_reader" AND NOT GRAYBOX_FUZZ)
    add_dependencies(${name} graybox_reader)
  endif()
endfunction()
