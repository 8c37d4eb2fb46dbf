# find_package(taclink) gives the target taclink::client.
include(CMakeFindDependencyMacro)
find_dependency(Protobuf)
include("${CMAKE_CURRENT_LIST_DIR}/taclink-targets.cmake")
