# find_package(taclink) gives the target taclink::client.
include("${CMAKE_CURRENT_LIST_DIR}/taclink-targets.cmake")
