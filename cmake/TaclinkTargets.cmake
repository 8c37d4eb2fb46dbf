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
                                                 -Wno-maybe-uninitialized)
  target_link_options(taclink_flags INTERFACE -fsanitize=${TACLINK_SANITIZER})
endif()

# taclink_library(NAME SOURCES ... LINKS ...): one static library a folder; LINKS are public.
function(taclink_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;LINKS" ${ARGN})
  add_library(${name} STATIC ${arg_SOURCES})
  target_link_libraries(${name} PUBLIC taclink_flags ${arg_LINKS})
endfunction()

# taclink_test(NAME SOURCES ... LINKS ... [LABELS ...] [TIMEOUT seconds]): one GoogleTest program, its cases known to
# ctest.
function(taclink_test name)
  cmake_parse_arguments(arg "" "TIMEOUT" "SOURCES;LINKS;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 300)
  endif()
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE taclink_flags ${arg_LINKS} GTest::gtest_main GTest::gmock)
  target_compile_definitions(${name} PRIVATE TACLINK_TEST_DATA="${PROJECT_SOURCE_DIR}/tests/data")
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST PROPERTIES TIMEOUT ${arg_TIMEOUT} LABELS "${arg_LABELS}")
endfunction()

# taclink_embed(TARGET FUNCTION NAME FILES ...): text files become `std::span<const EmbeddedFile> FUNCTION()`.
function(taclink_embed target)
  cmake_parse_arguments(arg "" "FUNCTION" "FILES" ${ARGN})
  set(output "${CMAKE_CURRENT_BINARY_DIR}/${arg_FUNCTION}.cpp")
  set(paths "")
  foreach(file IN LISTS arg_FILES)
    list(APPEND paths "${CMAKE_CURRENT_SOURCE_DIR}/${file}")
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
