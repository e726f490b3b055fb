# The Debian packages, which `packaging/deb` makes: a component of install.cmake each, and what a
# machine needs besides. That is EXCLUDE_FROM_ALL: it goes to places of Debian's own, and is in no
# other installation.
set(names_server stellate-server)
set(names_tools stellate-tools)
set(names_development libstellate-dev)
set(names_python python3-stellate)
set(names_mpi stellate-mpi)
set(of_debian server tools development python)
set(manuals server tools)
if(STELLATE_MPI)
  list(APPEND of_debian mpi)
  list(APPEND manuals mpi)
endif()

# The unit that packaging/install takes to /usr/local, for /usr.
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS packaging/stellated.service)
file(READ packaging/stellated.service unit)
string(REPLACE /usr/local/bin /usr/bin unit "${unit}")
file(CONFIGURE OUTPUT debian/stellated.service CONTENT "${unit}" @ONLY)

set(of_server COMPONENT server EXCLUDE_FROM_ALL)
install(FILES ${PROJECT_BINARY_DIR}/debian/stellated.service DESTINATION lib/systemd/system ${of_server})
install(FILES packaging/stellate.sysusers DESTINATION lib/sysusers.d RENAME stellate.conf ${of_server})
install(FILES packaging/stellate.tmpfiles DESTINATION lib/tmpfiles.d RENAME stellate.conf ${of_server})
install(FILES packaging/stellated.toml DESTINATION /etc/stellate ${of_server})
install(PROGRAMS docker/make-secrets DESTINATION lib/stellate ${of_server})
install(FILES packaging/debian/server/README.Debian DESTINATION share/doc/stellate-server ${of_server})

# Debian's own Python: the packages that it needs are Debian's, too.
configure_file(cmake/install_python.cmake.in install_python.cmake @ONLY)
install(SCRIPT ${PROJECT_BINARY_DIR}/install_python.cmake COMPONENT python EXCLUDE_FROM_ALL)

# Manual pages, of what the programs say with --help.
foreach(part ${manuals})
  install(CODE "
    execute_process(COMMAND ${PROJECT_SOURCE_DIR}/packaging/manual
      ${CMAKE_RUNTIME_OUTPUT_DIRECTORY} ${part} ${PROJECT_BINARY_DIR}/man/${part}
      COMMAND_ERROR_IS_FATAL ANY)" COMPONENT ${part} EXCLUDE_FROM_ALL)
endforeach()
install(DIRECTORY ${PROJECT_BINARY_DIR}/man/server/ DESTINATION share/man/man8 ${of_server})
install(DIRECTORY ${PROJECT_BINARY_DIR}/man/tools/ DESTINATION share/man/man1
  COMPONENT tools EXCLUDE_FROM_ALL)
if(STELLATE_MPI)
  install(DIRECTORY ${PROJECT_BINARY_DIR}/man/mpi/ DESTINATION share/man/man1
    COMPONENT mpi EXCLUDE_FROM_ALL)
endif()

foreach(component ${of_debian})
  set(name ${names_${component}})
  install(FILES LICENSE DESTINATION share/doc/${name} RENAME copyright
    COMPONENT ${component} EXCLUDE_FROM_ALL)
  string(TOUPPER ${component} COMPONENT)
  set(CPACK_DEBIAN_${COMPONENT}_PACKAGE_NAME ${name})
  file(GLOB control CONFIGURE_DEPENDS packaging/debian/${component}/*)
  list(FILTER control EXCLUDE REGEX README)
  set(CPACK_DEBIAN_${COMPONENT}_PACKAGE_CONTROL_EXTRA ${control})
  set(CPACK_DEBIAN_${COMPONENT}_PACKAGE_CONTROL_STRICT_PERMISSION ON)
endforeach()

set(CPACK_COMPONENT_SERVER_DESCRIPTION "Meshes smooth manifolds it never sees: the server
stellated asks its clients for points, and makes meshes of them with a
certificate. With a unit for systemd.")
set(CPACK_DEBIAN_SERVER_PACKAGE_SECTION science)
set(CPACK_DEBIAN_SERVER_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_SERVER_PACKAGE_DEPENDS
  "passwd, procps, systemd | systemd-standalone-sysusers, systemd | systemd-standalone-tmpfiles")
set(CPACK_DEBIAN_SERVER_PACKAGE_RECOMMENDS "ca-certificates, openssl")

set(CPACK_COMPONENT_TOOLS_DESCRIPTION "Meshes smooth manifolds: command line
The program stellate meshes on a server, fetches meshes from one, watches it,
and probes oracles.")
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION science)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_TOOLS_PACKAGE_RECOMMENDS
  "ca-certificates, stellate-server (= ${PROJECT_VERSION})")

set(CPACK_COMPONENT_MPI_DESCRIPTION "Meshes smooth manifolds: in the ranks of an MPI job
The program stellate-mpi makes one mesh in all ranks of a job, with an oracle in
each and without a server, and writes it whole or a piece a rank.")
set(CPACK_DEBIAN_MPI_PACKAGE_SECTION science)
set(CPACK_DEBIAN_MPI_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_MPI_PACKAGE_DEPENDS openmpi-bin)

set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "Meshes smooth manifolds: C++ libraries
Static libraries, headers, CMake package and pkg-config files: a client of the
server, and the core, which meshes without one.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
  "libeigen3-dev, libexpected-dev, libtbb-dev, libgrpc++-dev (>= ${gRPC_VERSION}), libprotobuf-dev, protobuf-compiler-grpc")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "stellate-server (= ${PROJECT_VERSION})")

set(CPACK_COMPONENT_PYTHON_DESCRIPTION "Meshes smooth manifolds: Python
The Python package stellate: oracles are functions of numpy arrays.")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
  "python3, python3-grpcio, python3-protobuf, python3-numpy, python3-meshio")
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "stellate-server (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS python3-matplotlib)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME stellate)
set(CPACK_PACKAGE_VENDOR Stellate)
set(CPACK_DEBIAN_PACKAGE_HOMEPAGE https://stellate.example)
# packaging/deb puts who made the packages here.
set(CPACK_PACKAGE_CONTACT "Made from source <root@localhost>")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL ${of_debian})
set(CPACK_COMPONENTS_GROUPING IGNORE)  # a package each
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
include(CPack)
