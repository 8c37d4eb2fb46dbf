# Flags and helpers for every target of this project.

# The Debug type is for the sanitizers: some optimisation, or the mechanics tests take minutes.
set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g1 -fno-omit-frame-pointer")
# GCC 12 warns of overlapping copies that are not there at -O3.
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")

add_library(taclink_flags INTERFACE)
target_compile_options(taclink_flags INTERFACE -Wall -Wextra -Wconversion -Wshadow -Werror)
target_include_directories(taclink_flags INTERFACE "${PROJECT_SOURCE_DIR}")
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
    # As -fsanitize=fuzzer-no-link, which does not go with headers that were compiled without it.
    set(coverage -fsanitize-coverage=inline-8bit-counters$<COMMA>indirect-calls$<COMMA>trace-cmp$<COMMA>pc-table)
    target_compile_options(taclink_flags INTERFACE $<IF:${fuzzed},${coverage},${fewer_checks}>)
  endif()
endif()
# clang warns of more than GCC; the builds by GCC are strict.
target_compile_options(taclink_flags INTERFACE $<$<CXX_COMPILER_ID:Clang>:-Wno-error>)

# Headers that most sources read take half of their compile time. Sets of them are compiled once: `library` for sensing,
# `thread` for all other libraries, `test` with GoogleTest, `rpc` and `rpc_test` where gRPC is in most sources. Sources
# include what they need all the same: the preset `tsan` goes without. All but sensing is then compiled with
# -pthread, for gRPC brings it and one set of headers has one set of flags.
option(TACLINK_PRECOMPILE "Precompile common headers" OFF)
set(TACLINK_COMMON_HEADERS <Eigen/Core> <algorithm> <array> <atomic> <chrono> <cmath> <condition_variable> <filesystem>
    <functional> <map> <memory> <mutex> <optional> <set> <span> <sstream> <string> <string_view> <thread> <utility>
    <variant> <vector>)
set(TACLINK_TEST_HEADERS <gmock/gmock.h> <gtest/gtest.h>)
set(TACLINK_RPC_HEADERS <grpcpp/grpcpp.h> <taclink/v1/operations.grpc.pb.h> <taclink/v1/recording.grpc.pb.h>
    <taclink/v1/tactile.grpc.pb.h>)

# taclink_header_set(NAME [PROGRAM] HEADERS ... LINKS ...): programs are compiled another way than libraries.
function(taclink_header_set set)
  cmake_parse_arguments(arg "PROGRAM" "" "HEADERS;LINKS" ${ARGN})
  if(arg_PROGRAM)
    add_executable(taclink_${set}_headers EXCLUDE_FROM_ALL "${PROJECT_BINARY_DIR}/precompiled.cpp")
  else()
    add_library(taclink_${set}_headers OBJECT "${PROJECT_BINARY_DIR}/precompiled.cpp")
  endif()
  if(NOT set STREQUAL library)
    target_compile_options(taclink_${set}_headers PRIVATE -pthread)
  endif()
  target_link_libraries(taclink_${set}_headers PRIVATE taclink_flags Eigen3::Eigen ${arg_LINKS})
  target_precompile_headers(taclink_${set}_headers PRIVATE ${TACLINK_COMMON_HEADERS} ${arg_HEADERS})
endfunction()

function(taclink_precompiled_headers)
  if(NOT TACLINK_PRECOMPILE)
    return()
  endif()
  file(WRITE "${PROJECT_BINARY_DIR}/precompiled.cpp" "int main() { return 0; }\n")
  taclink_header_set(library)
  taclink_header_set(thread)
  taclink_header_set(rpc HEADERS ${TACLINK_RPC_HEADERS} LINKS taclink_proto)
  if(TACLINK_BUILD_TESTS)
    taclink_header_set(test PROGRAM HEADERS ${TACLINK_TEST_HEADERS} LINKS GTest::gtest GTest::gmock)
    taclink_header_set(rpc_test PROGRAM HEADERS ${TACLINK_TEST_HEADERS} ${TACLINK_RPC_HEADERS}
                       LINKS GTest::gtest GTest::gmock taclink_proto)
  endif()
endfunction()

function(taclink_use_precompiled name set)
  if(TACLINK_PRECOMPILE)
    if(TACLINK_THREADS)
      target_compile_options(${name} PRIVATE -pthread)
    endif()
    # At -O2 GCC 12 warns of what std::string does inside precompiled headers.
    target_compile_options(${name} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds -Wno-restrict
                           -Wno-stringop-overflow -Wno-stringop-overread>)
    target_precompile_headers(${name} REUSE_FROM taclink_${set}_headers)
  endif()
endfunction()

# taclink_library(NAME SOURCES ... LINKS ... [HEADERS set]): one static library a folder; LINKS are public.
function(taclink_library name)
  cmake_parse_arguments(arg "" "HEADERS" "SOURCES;LINKS" ${ARGN})
  add_library(${name} STATIC ${arg_SOURCES})
  target_link_libraries(${name} PUBLIC taclink_flags ${arg_LINKS})
  if(arg_HEADERS)
    taclink_use_precompiled(${name} ${arg_HEADERS})
  elseif(TACLINK_THREADS)
    taclink_use_precompiled(${name} thread)
  else()
    taclink_use_precompiled(${name} library)
  endif()
endfunction()

# taclink_fast(TARGET [SOURCES ...]): all or these of its sources are compiled at -O3. GCC forgets that when it reads
# headers that were precompiled at -O2, so they go without.
function(taclink_fast target)
  set(sources ${ARGN})
  if(NOT sources)
    get_target_property(sources ${target} SOURCES)
  endif()
  set_source_files_properties(${sources} PROPERTIES COMPILE_OPTIONS "$<$<CONFIG:Release>:-O3>"
                                                    SKIP_PRECOMPILE_HEADERS ON)
endfunction()

# The programs of the tests labelled slow or vm, and of all others.
add_custom_target(slow_tests)
add_custom_target(quick_tests)

# taclink_test(NAME SOURCES ... LINKS ... [HEADERS set] [LABELS ...] [TIMEOUT seconds]): one GoogleTest program, its cases
# known to ctest. Under a sanitizer all of them run in one process, for each start would take longer than most cases.
function(taclink_test name)
  cmake_parse_arguments(arg "" "HEADERS;TIMEOUT" "SOURCES;LINKS;LABELS" ${ARGN})
  if(NOT arg_HEADERS)
    set(arg_HEADERS test)
  endif()
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 300)
  endif()
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE taclink_flags ${arg_LINKS} GTest::gtest_main GTest::gmock)
  target_compile_definitions(${name} PRIVATE TACLINK_TEST_DATA="${PROJECT_SOURCE_DIR}/tests/data")
  taclink_use_precompiled(${name} ${arg_HEADERS})
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
