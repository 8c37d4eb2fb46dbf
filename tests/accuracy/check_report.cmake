# Compares the hash of the sources of sensing/, of the judge and of the solids with the one that report.csv was made with, or prints it (-DPRINT=ON):
#   cmake -DROOT=<source dir> -P check_report.cmake
file(GLOB_RECURSE sources RELATIVE "${ROOT}" "${ROOT}/sensing/*.h" "${ROOT}/sensing/*.cpp" "${ROOT}/sensing/*.yaml"
     "${ROOT}/tests/accuracy/solid_*" "${ROOT}/tests/accuracy/accuracy_*" "${ROOT}/tests/accuracy/calculix/*.csv")
list(FILTER sources EXCLUDE REGEX "_test\\.cpp$")
list(SORT sources)
set(hashes "")
foreach(source IN LISTS sources)
  file(SHA256 "${ROOT}/${source}" hash)
  string(APPEND hashes "${source} ${hash}\n")
endforeach()
string(SHA256 hash "${hashes}")
if(PRINT)
  message("${hash}")
  return()
endif()
file(STRINGS "${ROOT}/tests/accuracy/report.csv" recorded REGEX "^# sensing " LIMIT_COUNT 1)
if(NOT recorded STREQUAL "# sensing ${hash}")
  message(FATAL_ERROR "sensing/, the judge or the solids have changed since tests/accuracy/report.csv was made (recorded: '${recorded}', now: "
                      "'# sensing ${hash}'). Run deploy/accuracy --update, review the report's diff and commit it.")
endif()
