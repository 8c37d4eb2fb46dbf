# What is installed, and the Debian packages made of it: cmake --preset package; deploy/package runs it all.
include(GNUInstallDirs)
set(docs "${CMAKE_INSTALL_DOCDIR}")
install(TARGETS taclinkd taclink RUNTIME COMPONENT server)
install(FILES deploy/taclinkd.service DESTINATION lib/systemd/system COMPONENT server)
install(FILES deploy/config/demo.yaml DESTINATION /etc/taclink RENAME taclinkd.yaml COMPONENT server)
install(DIRECTORY deploy/config/ DESTINATION "${docs}/examples" COMPONENT server)
install(FILES deploy/package/completion.bash DESTINATION "${CMAKE_INSTALL_DATADIR}/bash-completion/completions"
        RENAME taclink COMPONENT server)
install(DIRECTORY client/cpp/example DESTINATION "${docs}-client" COMPONENT development)
install(FILES LICENSE DESTINATION "${docs}" RENAME copyright COMPONENT server)
if(TACLINK_WEB)
  install(FILES "${PROJECT_BINARY_DIR}/web/dist/licenses.txt" DESTINATION "${docs}" RENAME dashboard-licenses.txt
          COMPONENT server)
endif()

option(TACLINK_PACKAGE "Make manual pages and the list of parts for packages (needs help2man and python3)" OFF)
if(NOT TACLINK_PACKAGE)
  return()
endif()
# The same sources give the same bytes, wherever they lie.
target_compile_options(taclink_flags INTERFACE "-ffile-prefix-map=${PROJECT_SOURCE_DIR}=."
                                               "-ffile-prefix-map=${PROJECT_BINARY_DIR}=build")
find_program(HELP2MAN help2man REQUIRED)
set(made "${PROJECT_BINARY_DIR}/package")
set(make_manual "${PROJECT_SOURCE_DIR}/deploy/package/make-manual")
set(make_parts "${PROJECT_SOURCE_DIR}/deploy/package/make-parts")
add_custom_command(
  OUTPUT "${made}/taclink.1.gz" "${made}/taclinkd.1.gz" "${made}/parts.cdx.json"
  COMMAND "${make_manual}" "$<TARGET_FILE_DIR:taclink>" "${made}"
  COMMAND "${make_parts}" "${PROJECT_VERSION}" "${PROJECT_SOURCE_DIR}/web/package-lock.json"
          $<TARGET_FILE:taclinkd> $<TARGET_FILE:taclink> > "${made}/parts.cdx.json"
  DEPENDS taclink taclinkd "${make_manual}" "${make_parts}" web/package-lock.json
  COMMENT "Making manual pages and the list of parts" VERBATIM)
add_custom_target(taclink_package_files ALL DEPENDS "${made}/taclink.1.gz" "${made}/parts.cdx.json")
install(FILES "${made}/taclink.1.gz" "${made}/taclinkd.1.gz" DESTINATION "${CMAKE_INSTALL_MANDIR}/man1"
        COMPONENT server)
install(FILES "${made}/parts.cdx.json" DESTINATION "${docs}" COMPONENT server)

# The Python client, with its generated code.
find_program(PYTHON python3 PATHS /usr/bin NO_DEFAULT_PATH REQUIRED)
add_custom_target(taclink_package_python ALL
  COMMAND ${CMAKE_COMMAND} -E rm -rf "${made}/python"
  COMMAND "${PYTHON}" setup.py --quiet build_py --build-lib "${made}/python"
  WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}/client/python" COMMENT "Generating the Python client" VERBATIM)
install(DIRECTORY "${made}/python/" DESTINATION lib/python3/dist-packages COMPONENT python PATTERN __pycache__ EXCLUDE)
install(DIRECTORY client/python/examples DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/python3-taclink" COMPONENT python
        PATTERN __pycache__ EXCLUDE)

set(CPACK_GENERATOR DEB)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL server library development python)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_CONTACT "The TacLINK server's maintainers <maintainers@taclink.invalid>")
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_SERVER_PACKAGE_NAME taclink)
set(CPACK_DEBIAN_SERVER_PACKAGE_DEPENDS adduser)
set(control "${PROJECT_SOURCE_DIR}/deploy/package")
set(CPACK_DEBIAN_SERVER_PACKAGE_CONTROL_EXTRA
    "${control}/postinst" "${control}/prerm" "${control}/postrm" "${control}/conffiles")
set(CPACK_DEBIAN_SERVER_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libtaclink-client${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA "${control}/triggers")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libtaclink-client-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "libtaclink-client${PROJECT_VERSION_MAJOR} (= ${PROJECT_VERSION}), libprotobuf-dev")
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-taclink)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3, python3-grpcio, python3-protobuf, python3-numpy")
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS python3-matplotlib)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Soft tactile robot links (TacLINK)")
set(CPACK_COMPONENT_SERVER_DESCRIPTION "Server and command. taclinkd runs the links of a robot arm: cameras, shapes of
their skins, contact forces; over gRPC, with a dashboard. taclink is its command.")
set(CPACK_COMPONENT_LIBRARY_DESCRIPTION "Client library: typed access to a taclinkd from C++.")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "Client library, for development: headers, files for CMake and pkg-config,
an example.")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION "Python client: NumPy arrays, blocking and asyncio.")
include(CPack)
