/* Each function of the header; it is the only include. */
#include "ringcat.h"

int use(ec_master_t *master, ringcat_variable_t *variable);

int use(ec_master_t *master, ringcat_variable_t *variable)
{
    const int loaded = ringcat_master_load_network(master, "machine.toml");

    const int others = ringcat_master_load_network_data(master, "", 0) || ringcat_master_load_eni(master, "machine.xml")
        || ringcat_master_load_eni_data(master, "", 0);

    return loaded || others || !ringcat_master_subdevice(master, "Drive") || !ringcat_master_domain(master, "cycle")
        || ringcat_master_variable(master, "Drive.Feedback.Statusword", variable);
}
