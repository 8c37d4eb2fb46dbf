# Flags and helpers for every target of this project.

# The Debug type is for the sanitizers: some optimisation, or the mechanics tests take minutes.
set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g1 -fno-omit-frame-pointer")
# GCC 12 warns of overlapping copies that are not there at -O3.
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")

add_library(taclink_flags INTERFACE)
target_compile_options(taclink_flags INTERFACE -Wall -Wextra -Wconversion -Wshadow -Werror)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 13)
  # From GCC 13 on, inlined copies of an empty std::optional of an Eigen matrix are reported.
  target_compile_options(taclink_flags INTERFACE -Wno-error=maybe-uninitialized)
endif()
target_include_directories(taclink_flags INTERFACE "${PROJECT_SOURCE_DIR}")
# What limits the damage of a memory error, at the cost of some percent. _FORTIFY_SOURCE needs optimization, and the
# sanitizers check the same accesses.
if(NOT TACLINK_SANITIZER)
  include(CheckPIESupported)
  check_pie_supported(LANGUAGES CXX)  # so that programs are linked as CMAKE_POSITION_INDEPENDENT_CODE says
  target_compile_options(taclink_flags INTERFACE
    "$<$<CONFIG:Release>:-fstack-protector-strong;-fstack-clash-protection;-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=2>")
  target_link_options(taclink_flags INTERFACE "$<$<CONFIG:Release>:LINKER:-z,relro,-z,now>")
endif()
# GCC takes sources that are included for headers.
if(TACLINK_BATCH_SIZE GREATER 1)
  target_compile_options(taclink_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()
# Sanitizers instrument the code that parses foreign bytes or manages memory. The numerical libraries (taclink_library's
# NUMERICAL) are optimized and not instrumented in the address sanitizer's build, with assertions on.
add_library(taclink_instrumented INTERFACE)
target_link_libraries(taclink_instrumented INTERFACE taclink_flags)
if(TACLINK_SANITIZER)
  # Eigen aligns by hand under a sanitizer, but not in Ceres' library, whose copies of Eigen's functions may be linked.
  target_compile_definitions(taclink_flags INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1)
  # GCC warns of uninitialized values that do not exist once the sanitizers change the code.
  target_compile_options(taclink_instrumented INTERFACE -fsanitize=${TACLINK_SANITIZER} -fno-sanitize-recover=all
                                                        $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  target_link_options(taclink_flags INTERFACE -fsanitize=${TACLINK_SANITIZER})
  if(TACLINK_SANITIZER MATCHES "undefined")
    set(fuzzed $<BOOL:$<TARGET_PROPERTY:TACLINK_FUZZED>>)
    # Checks of every access, most of which the address sanitizer makes as well: with them Eigen's code takes twice as
    # long to compile. Fuzzed code has them.
    set(fewer_checks -fno-sanitize=null$<COMMA>alignment$<COMMA>object-size$<COMMA>pointer-overflow)
    # What -fsanitize=fuzzer-no-link sets.
    set(coverage -fsanitize-coverage=inline-8bit-counters$<COMMA>indirect-calls$<COMMA>trace-cmp$<COMMA>pc-table)
    target_compile_options(taclink_instrumented INTERFACE $<IF:${fuzzed},${coverage},${fewer_checks}>)
  endif()
endif()
# clang warns of more than GCC; the builds by GCC are strict.
target_compile_options(taclink_flags INTERFACE $<$<CXX_COMPILER_ID:Clang>:-Wno-error>)

# Sources are compiled TACLINK_BATCH_SIZE together, because most read the same headers: a cold build takes a third of the
# time. Names in unnamed namespaces must therefore differ within a target; the preset lint compiles each source by itself.
# CMake's own unity build is not used: its files name sources by absolute path, so that no other checkout could take
# an object from the compiler cache.
set(TACLINK_BATCH_SIZE 1 CACHE STRING "Sources that are compiled together")
set(CMAKE_UNITY_BUILD OFF)  # build folders from before may have it on

# taclink_batches(TARGET RESULT SOURCES ...): the files to compile in place of SOURCES, as absolute paths.
function(taclink_batches target result)
  set(paths "")
  foreach(source IN LISTS ARGN)
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE)
    list(APPEND paths "${source}")
  endforeach()
  list(LENGTH paths count)
  if(count LESS 2 OR TACLINK_BATCH_SIZE LESS 2)
    set(${result} "${paths}" PARENT_SCOPE)
    return()
  endif()
  set(batches "")
  math(EXPR last "${count} - 1")
  foreach(first RANGE 0 ${last} ${TACLINK_BATCH_SIZE})
    list(SUBLIST paths ${first} ${TACLINK_BATCH_SIZE} batch)
    set(content "")
    foreach(path IN LISTS batch)
      cmake_path(RELATIVE_PATH path BASE_DIRECTORY "${PROJECT_SOURCE_DIR}")
      string(APPEND content "#include \"${path}\"\n")
    endforeach()
    set(file "${CMAKE_CURRENT_BINARY_DIR}/${target}_${first}.cpp")
    file(CONFIGURE OUTPUT "${file}" CONTENT "${content}" @ONLY)  # written only if it differs
    list(APPEND batches "${file}")
  endforeach()
  set(${result} "${batches}" PARENT_SCOPE)
endfunction()

# taclink_library(NAME SOURCES ... [FAST ...] LINKS ... [NUMERICAL]): one static library a folder; LINKS are public. The
# FAST sources, each by itself, and those of a NUMERICAL library are compiled at -O3.
function(taclink_library name)
  cmake_parse_arguments(arg "NUMERICAL" "" "SOURCES;FAST;LINKS" ${ARGN})
  taclink_batches(${name} sources ${arg_SOURCES})
  add_library(${name} STATIC ${sources} ${arg_FAST})
  target_link_libraries(${name} PUBLIC taclink_flags ${arg_LINKS})
  set(optimize "$<$<CONFIG:Release>:-O3>")
  if(arg_FAST)
    set_source_files_properties(${arg_FAST} PROPERTIES COMPILE_OPTIONS "${optimize}")
  endif()
  if(NOT arg_NUMERICAL)
    target_link_libraries(${name} PRIVATE taclink_instrumented)
  elseif(TACLINK_SANITIZER MATCHES "address")
    target_compile_options(${name} PRIVATE -O2)
  else()
    target_link_libraries(${name} PRIVATE taclink_instrumented)
    target_compile_options(${name} PRIVATE "${optimize}")
  endif()
endfunction()

# taclink_program(NAME SOURCES ... LINKS ...)
function(taclink_program name)
  cmake_parse_arguments(arg "" "" "SOURCES;LINKS" ${ARGN})
  taclink_batches(${name} sources ${arg_SOURCES})
  add_executable(${name} ${sources})
  target_link_libraries(${name} PRIVATE taclink_instrumented ${arg_LINKS})
endfunction()

# taclink_embed(TARGET FUNCTION NAME FILES ...): files become `std::span<const EmbeddedFile> FUNCTION()`.
function(taclink_embed target)
  cmake_parse_arguments(arg "" "FUNCTION" "FILES" ${ARGN})
  set(output "${CMAKE_CURRENT_BINARY_DIR}/${arg_FUNCTION}.cpp")
  set(paths "")
  foreach(file IN LISTS arg_FILES)
    cmake_path(ABSOLUTE_PATH file BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE OUTPUT_VARIABLE path)
    list(APPEND paths "${path}")
  endforeach()
  string(REPLACE ";" "," joined "${paths}")
  add_custom_command(
    OUTPUT "${output}"
    COMMAND ${CMAKE_COMMAND} -DOUTPUT=${output} -DFUNCTION=${arg_FUNCTION} "-DFILES=${joined}"
            -P "${PROJECT_SOURCE_DIR}/cmake/Embed.cmake"
    DEPENDS ${paths} "${PROJECT_SOURCE_DIR}/cmake/Embed.cmake"
    VERBATIM)
  target_sources(${target} PRIVATE "${output}")
endfunction()
