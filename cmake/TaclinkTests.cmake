# Tests. Every test has one label that says what it needs of the machine, and ctest runs accordingly:
#   unit      one process that computes; several run side by side
#   live      starts servers or clients and waits for them: it gets both cores (PROCESSORS 2)
#   vm        boots a virtual machine, alone
#   network   takes packages from a registry
#   accuracy  compares forces and shapes with solids and measured data
# `live`, `vm` and `network` may be repeated once if they fail (deploy/test), `unit` and `accuracy` never.
# A test runs in one stage of deploy/test, or in both: with the address sanitizer (label `sanitized`, target sanitized_tests) if it is
# there to exercise code that parses foreign bytes or manages memory, otherwise (OPTIMIZED, target optimized_tests) as
# users run the code, because it is about numbers, memory bounds or time. A test that checks foreign bytes and memory
# bounds at once runs in both (BOTH_STAGES), and so do the tests of numerical code that are quick with its assertions on.
add_custom_target(sanitized_tests)
add_custom_target(optimized_tests)
set(TACLINK_TEST_KINDS unit live vm network accuracy)

# taclink_test_properties(TEST KIND [PROPERTY value ...])
function(taclink_test_properties test kind)
  if(NOT kind IN_LIST TACLINK_TEST_KINDS)
    message(FATAL_ERROR "${test}: the kind of a test is one of ${TACLINK_TEST_KINDS}, not '${kind}'")
  endif()
  set_tests_properties(${test} PROPERTIES LABELS ${kind} ${ARGN})
  if(kind STREQUAL live)
    set_tests_properties(${test} PROPERTIES PROCESSORS 2)
  elseif(kind STREQUAL vm)
    set_tests_properties(${test} PROPERTIES RUN_SERIAL ON)
  endif()
endfunction()

# Paths of this checkout, for tests/support/paths.h.
configure_file("${PROJECT_SOURCE_DIR}/tests/support/paths.cpp.in" "${PROJECT_BINARY_DIR}/tests/paths.cpp" @ONLY)
add_library(taclink_test_paths STATIC "${PROJECT_BINARY_DIR}/tests/paths.cpp")
target_link_libraries(taclink_test_paths PUBLIC taclink_flags)

# taclink_test(NAME SOURCES ... LINKS ... [KIND kind] [OPTIMIZED | BOTH_STAGES] [TIMEOUT seconds]): one GoogleTest program, its cases
# known to ctest. Under a sanitizer all of them run in one process, because each start would take longer than most cases.
function(taclink_test name)
  cmake_parse_arguments(arg "OPTIMIZED;BOTH_STAGES" "KIND;TIMEOUT" "SOURCES;LINKS" ${ARGN})
  if(arg_OPTIMIZED AND TACLINK_SANITIZER)
    return()
  endif()
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 600)
  endif()
  if(NOT arg_KIND)
    set(arg_KIND unit)
  endif()
  taclink_program(${name} SOURCES ${arg_SOURCES} LINKS ${arg_LINKS} taclink_test_paths GTest::gtest_main GTest::gmock)
  if(NOT arg_OPTIMIZED)
    add_dependencies(sanitized_tests ${name})
  endif()
  if(arg_OPTIMIZED OR arg_BOTH_STAGES)
    add_dependencies(optimized_tests ${name})
  endif()
  if(TACLINK_SANITIZER)
    add_test(NAME ${name} COMMAND ${name} --gtest_brief=1)
    taclink_test_properties(${name} ${arg_KIND} TIMEOUT 1200)
    return()
  endif()
  set(labels ${arg_KIND})
  if(NOT arg_OPTIMIZED AND NOT arg_BOTH_STAGES)
    list(APPEND labels sanitized)
  endif()
  set(processors 1)
  if(arg_KIND STREQUAL live)
    set(processors 2)
  endif()
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 120
                       PROPERTIES TIMEOUT ${arg_TIMEOUT} PROCESSORS ${processors} LABELS "${labels}")
endfunction()
