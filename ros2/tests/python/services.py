"""Services of ROS 2 as their definitions have them; rosbags takes definitions of messages alone."""

from rosbags.typesys import get_types_from_msg

EVENT = "service_msgs/msg/ServiceEventInfo"
# Package, and of each service what is asked and what is answered.
SERVICES = {
    "std_srvs": {"Trigger": ("", "bool success\nstring message\n")},
    "rcl_interfaces": {
        "ListParameters": (
            "string[] prefixes\nuint64 depth\nuint64 DEPTH_RECURSIVE=0\n",
            "rcl_interfaces/ListParametersResult result\n",
        ),
        "GetParameters": ("string[] names\n", "rcl_interfaces/ParameterValue[] values\n"),
        "GetParameterTypes": ("string[] names\n", "uint8[] types\n"),
        "DescribeParameters": ("string[] names\n", "rcl_interfaces/ParameterDescriptor[] descriptors\n"),
        "SetParameters": (
            "rcl_interfaces/Parameter[] parameters\n",
            "rcl_interfaces/SetParametersResult[] results\n",
        ),
        "SetParametersAtomically": (
            "rcl_interfaces/Parameter[] parameters\n",
            "rcl_interfaces/SetParametersResult result\n",
        ),
    },
}


def definitions(name, request, response):
    """The four types of a service."""
    return {
        f"{name}_Request": request,
        f"{name}_Response": response,
        f"{name}_Event": (
            f"service_msgs/ServiceEventInfo info\n{name}_Request[<=1] request\n{name}_Response[<=1] response\n"
        ),
        name: f"{name}_Request request_message\n{name}_Response response_message\n{name}_Event event_message\n",
    }


def renamed(value, package, names):
    """Made as messages, the types of a service get their names."""
    if isinstance(value, str):
        front, _, name = value.rpartition("/")
        return f"{package}/srv/{name}" if front == f"{package}/msg" and name in names else value
    return type(value)(renamed(each, package, names) for each in value) if isinstance(value, (tuple, list)) else value


def register(types):
    """Makes the services known to the hashes of a store, under their own names."""
    event = "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\nint64 sequence_number\n"
    # The store has char for what ROS takes as uint8.
    types.fielddefs[EVENT] = get_types_from_msg(event, EVENT)[EVENT]
    for package, services in SERVICES.items():
        for service, (request, response) in services.items():
            all_types = definitions(service, request, response)
            for name, definition in all_types.items():
                types.fielddefs.update(get_types_from_msg(definition, f"{package}/msg/{name}"))
                own = types.fielddefs[f"{package}/msg/{name}"]
                types.fielddefs[f"{package}/srv/{name}"] = renamed(own, package, all_types)
