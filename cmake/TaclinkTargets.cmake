# Flags and helpers for every target of this project.

# The Debug type is for the sanitizers: some optimisation, or the mechanics tests take minutes.
set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g1 -fno-omit-frame-pointer")
# GCC 12 warns of overlapping copies that are not there at -O3.
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")

add_library(taclink_flags INTERFACE)
target_compile_options(taclink_flags INTERFACE -Wall -Wextra -Wconversion -Wshadow -Werror)
target_include_directories(taclink_flags INTERFACE "${PROJECT_SOURCE_DIR}")
# The presets compile the sources of a target eight together, for most read the same headers: a cold build takes a third
# of the time. Names in unnamed namespaces may meet, then. The presets tsan and lint compile each source by itself.
# GCC takes sources that are included for headers.
if(CMAKE_UNITY_BUILD)
  target_compile_options(taclink_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()
if(TACLINK_SANITIZER)
  # Eigen aligns by hand under a sanitizer, but not in Ceres' library, whose copies of Eigen's functions may be linked.
  target_compile_definitions(taclink_flags INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1)
  # GCC warns of uninitialised values that are not there once the sanitizers change the code.
  target_compile_options(taclink_flags INTERFACE -fsanitize=${TACLINK_SANITIZER} -fno-sanitize-recover=all
                                                 $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  target_link_options(taclink_flags INTERFACE -fsanitize=${TACLINK_SANITIZER})
  if(TACLINK_SANITIZER MATCHES "undefined")
    set(fuzzed $<BOOL:$<TARGET_PROPERTY:TACLINK_FUZZED>>)
    set(fewer_checks -fno-sanitize=null$<COMMA>alignment$<COMMA>object-size$<COMMA>pointer-overflow)
    # Checks of every access, most of which the address sanitizer makes as well: with them Eigen's code takes twice as
    # long to compile. What is fuzzed has them.
    # What -fsanitize=fuzzer-no-link sets.
    set(coverage -fsanitize-coverage=inline-8bit-counters$<COMMA>indirect-calls$<COMMA>trace-cmp$<COMMA>pc-table)
    target_compile_options(taclink_flags INTERFACE $<IF:${fuzzed},${coverage},${fewer_checks}>)
  endif()
endif()
# clang warns of more than GCC; the builds by GCC are strict.
target_compile_options(taclink_flags INTERFACE $<$<CXX_COMPILER_ID:Clang>:-Wno-error>)

# taclink_library(NAME SOURCES ... LINKS ...): one static library a folder; LINKS are public.
function(taclink_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;LINKS" ${ARGN})
  add_library(${name} STATIC ${arg_SOURCES})
  target_link_libraries(${name} PUBLIC taclink_flags ${arg_LINKS})
endfunction()

# taclink_fast(TARGET [SOURCES ...]): all or these of its sources are compiled at -O3.
function(taclink_fast target)
  if(ARGN)
    set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS "$<$<CONFIG:Release>:-O3>")
  else()
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O3>)
  endif()
endfunction()

# The programs of the tests labelled slow or vm, and of all others.
add_custom_target(slow_tests)
add_custom_target(quick_tests)

# taclink_test(NAME SOURCES ... LINKS ... [LABELS ...] [TIMEOUT seconds]): one GoogleTest program, its cases
# known to ctest. Under a sanitizer all of them run in one process, for each start would take longer than most cases.
function(taclink_test name)
  cmake_parse_arguments(arg "" "TIMEOUT" "SOURCES;LINKS;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 300)
  endif()
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE taclink_flags ${arg_LINKS} GTest::gtest_main GTest::gmock)
  target_compile_definitions(${name} PRIVATE TACLINK_TEST_DATA="${PROJECT_SOURCE_DIR}/tests/data")
  if("slow" IN_LIST arg_LABELS)
    add_dependencies(slow_tests ${name})
  else()
    add_dependencies(quick_tests ${name})
  endif()
  if(TACLINK_SANITIZER)
    add_test(NAME ${name} COMMAND ${name} --gtest_brief=1)
    set_tests_properties(${name} PROPERTIES TIMEOUT 1200 LABELS "${arg_LABELS}")
    return()
  endif()
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST PROPERTIES TIMEOUT ${arg_TIMEOUT} LABELS "${arg_LABELS}")
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
